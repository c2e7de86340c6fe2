#!/usr/bin/env python3
"""Mechanisms and nets of growing size beside peers, by exported C; how families grow. See README.md."""

import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import time

from run import MODELS, ROOT, ROUNDS, casadi_links, in_environment, links_text, model, pinocchio_links, row

# Sizes that fit into minutes; `--large` takes those beyond.
LARGE = "--large" in sys.argv


def halfarrow():
    """The program: built in release, or the one that HALFARROW names."""
    given = os.environ.get("HALFARROW")
    if given:
        return pathlib.Path(given)
    subprocess.run(["cargo", "build", "--release", "--bin", "halfarrow"], cwd=ROOT, check=True)
    return ROOT / "target" / "release" / "halfarrow"


DRIVER = r"""
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "NAME.h"
#define BATCHES 101
static NAME m;
static double x[STATES], dx[STATES];
static int order(const void *a, const void *b)
{
    const double d = *(const double *)a - *(const double *)b;
    return d > 0 ? 1 : d < 0 ? -1 : 0;
}
int main(int argc, char **argv)
{
    const long count = atol(argv[1]);
    double times[BATCHES];
    struct timespec from, to;
    long k;
    int i, batch;
    (void)argc;
    if (NAME_reset(&m) != 0 || NAME_start(&m, 0.0) != 0) { return 1; }
    for (batch = 0; batch < BATCHES; ++batch) {
        for (i = 0; i < STATES; ++i) { x[i] = m.x[i]; }
        clock_gettime(CLOCK_MONOTONIC, &from);
        for (k = 0; k < count; ++k) {
            if (NAME_rates(&m, 0.0, x, dx) != 0) { return 2; }
            for (i = 0; i < STATES; ++i) { x[i] += 1e-9 * (dx[i] + 1.0); } /* each waits for the one before, and none is that before */
        }
        clock_gettime(CLOCK_MONOTONIC, &to);
        times[batch] = ((to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec)) / count;
    }
    qsort(times, BATCHES, sizeof times[0], order);
    printf("{\"ns\": %.17g, \"rates\": [", times[BATCHES / 2]);
    for (i = 0; i < STATES; ++i) printf("%s%.17g", i ? ", " : "", dx[i]);
    printf("]}\n");
    return 0;
}
"""


def timed(*command):
    """Seconds of a command, and what it printed."""
    from_ = time.perf_counter()
    done = subprocess.run([*map(str, command)], check=True, capture_output=True, text=True)
    return time.perf_counter() - from_, done.stdout


def exported(program, path):
    """A program that times the rates of a model in exported C, and the seconds that it takes to export it."""
    folder = MODELS / f"exported_{path.stem}"
    seconds, _ = timed(program, "export", "c", path, "--out", folder, "--method", "heun", "--step", "1e-6")
    header = next(folder.glob("*.h"))
    name = header.stem
    states = int(re.search(r"double x\[(\d+)\];", header.read_text()).group(1))
    (folder / "bench.c").write_text(DRIVER.replace("NAME", name).replace("STATES", str(states)))
    sources = [folder / "bench.c", folder / f"{name}.c"]
    subprocess.run(["cc", "-O2", "-w", "-I", folder, "-o", folder / "bench", *sources, "-lm"], check=True)
    return folder / "bench", seconds


def nanoseconds(bench, count):
    return json.loads(subprocess.run([bench, str(count)], check=True, capture_output=True, text=True).stdout)


def ratio(a, b):
    return f"{a / b:.2f}"


def scale(ns):
    return f"{ns:.0f} ns" if ns < 1e3 else f"{ns / 1e3:.2f} µs" if ns < 1e6 else f"{ns / 1e6:.2f} ms"


def exponent(sizes, values):
    """The power by which values grow, by least squares of logarithms."""
    x, y = [math.log(s) for s in sizes], [math.log(v) for v in values]
    mx, my = statistics.mean(x), statistics.mean(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx) ** 2 for a in x)


def links(program):
    print("\nPendulum of n links, one evaluation of the accelerations (medians of", ROUNDS, "rounds in turns)\n")
    row("n", "exported C", "CasADi, LDLT", "ratio", "pinocchio, called from Python", "ratio", "to export")
    row(*["---"] * 7)
    sizes, times = (10, 20, 100, 1000)[: 4 if LARGE else 3], []
    for n in sizes:
        bench, seconds = exported(program, model(f"links_{n}", links_text(n)))
        peer = casadi_links(n) if n <= 20 else None
        other, _ = pinocchio_links(n)
        mine, there, called = [], [], []
        for _ in range(ROUNDS):
            mine.append(nanoseconds(bench, max(20000 // n, 20))["ns"])
            called.append(other(max(200000 // n, 50)))
            if peer:
                there.append(nanoseconds(peer, 4000 // (n * n) + 50)["ns"])
        a, c = statistics.median(mine), statistics.median(called)
        b = statistics.median(there) if there else None
        times.append(a)
        row(n, scale(a), scale(b) if b else "", ratio(a, b) if b else "", scale(c), ratio(a, c), f"{seconds:.1f} s")
    print(f"\nexponent from {sizes[-2]} to {sizes[-1]}: {exponent(sizes[-2:], times[-2:]):.2f}")


NEWTON = r"""
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#define BATCHES 51
/* Nodes 0 to N-1 behind resistors f = e + e^3, a leak of the same law at each; the last one is held by a capacitor. */
static double u[N], d[N], o[N], r[N];
static int order(const void *a, const void *b)
{
    const double x = *(const double *)a - *(const double *)b;
    return x > 0 ? 1 : x < 0 ? -1 : 0;
}
static double law(double e) { return e + e * e * e; }
static double slope(double e) { return 1.0 + 3.0 * e * e; }
static double rate(double held)
{
    int i, pass;
    u[N - 1] = held;
    for (pass = 0; pass < 50; ++pass) {
        double most = 0.0;
        for (i = 0; i < N - 1; ++i) {
            const double left = (i > 0 ? u[i - 1] : 1.0) - u[i], right = u[i] - u[i + 1];
            r[i] = law(left) - law(u[i]) - law(right);
            o[i] = slope(right);
            d[i] = slope(left) + slope(u[i]) + o[i];
        }
        for (i = 1; i < N - 1; ++i) {
            const double factor = o[i - 1] / d[i - 1];
            d[i] -= factor * o[i - 1];
            r[i] += factor * r[i - 1];
        }
        for (i = N - 2; i >= 0; --i) {
            r[i] = (r[i] + (i < N - 2 ? o[i] * r[i + 1] : 0.0)) / d[i];
            u[i] += r[i];
            most = fmax(most, fabs(r[i]));
        }
        if (most < 1e-12) { break; }
    }
    return law(u[N - 2] - held) - law(held);
}
int main(int argc, char **argv)
{
    const long count = atol(argv[1]);
    double times[BATCHES], q = 0.0, dq = 0.0;
    struct timespec from, to;
    long k;
    int batch;
    (void)argc;
    for (batch = 0; batch < BATCHES; ++batch) {
        q = 0.0;
        clock_gettime(CLOCK_MONOTONIC, &from);
        for (k = 0; k < count; ++k) { dq = rate(q / 0.1); q += 1e-9 * (dq + 1.0); }
        clock_gettime(CLOCK_MONOTONIC, &to);
        times[batch] = ((to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec)) / count;
    }
    qsort(times, BATCHES, sizeof times[0], order);
    printf("{\"ns\": %.17g, \"rates\": [%.17g]}\n", times[BATCHES / 2], dq);
    return 0;
}
"""


def mesh_text(n):
    law = "(f = g*(e + e^3))"
    lines = ["model Net", f"param n = {n}, g = 1, c = 0.1", "for i in 1..n {", f"    1:wire[i] -> R:series[i]{law}"]
    lines += [f"    wire[i] -> 0:node[i] -> R:leak[i]{law}", "    if i == 1 {", "        Se:source(1) -> wire[i]"]
    lines += ["    } else {", "        node[i - 1] -> wire[i]", "    }", "}", "node[n] -> C:end(c)"]
    return "\n".join(lines) + "\n"


def mesh(program):
    print("\nNonlinear net with a loop of class 2 in every section, one evaluation (medians of", ROUNDS, "rounds in turns)\n")
    row("sections", "Newton with a tridiagonal solution by hand", "exported C", "ratio", "to export")
    row(*["---"] * 5)
    for n in (100, 1000, 10000)[: 3 if LARGE else 2]:
        folder = MODELS / f"newton_{n}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "main.c").write_text(NEWTON)
        subprocess.run(["cc", "-O2", f"-DN={n}", "-o", folder / "newton", folder / "main.c", "-lm"], check=True)
        bench, seconds = exported(program, model(f"net_{n}", mesh_text(n)))
        there, mine = [], []
        for _ in range(ROUNDS):
            there.append(nanoseconds(folder / "newton", max(20000 // n, 5)))
            mine.append(nanoseconds(bench, max(20000 // n, 5)))
        off = abs(there[0]["rates"][0] - mine[0]["rates"][0])
        assert off < 1e-9, f"rates differ by {off}"
        a, b = (statistics.median(found["ns"] for found in side) for side in (there, mine))
        row(n, scale(a), scale(b), ratio(b, a), f"{seconds:.1f} s")


# Families with sizes over a decade of cells, larger ones with `--large`, and the power of a size that its cells are.
FAMILIES = {
    "ladder": ((100, 300, 1000), (1000, 3000, 10000), 1),
    "mesh": ((6, 11, 19), (19, 34, 60), 2),
    "grid": ((6, 11, 19), (19, 34, 60), 2),
    "chain": ((10, 30, 100), (40, 120, 400), 1),
    "beam": ((10, 30, 100), (40, 120, 400), 1),
    "fourbars": ((4, 12, 40), (10, 30, 100), 1),
}


def growth(program):
    print("\nHow families grow over a decade of cells: exponents by least squares\n")
    row("family", "sizes", "text to equations and code", "exponent", "one evaluation in exported C", "exponent")
    row(*["---"] * 6)
    for family, (small, large, power) in FAMILIES.items():
        sizes = large if LARGE else small
        compiling, evaluating = [], []
        for n in sizes:
            path = MODELS / f"{family}_{n}.bond"
            MODELS.mkdir(exist_ok=True)
            path.unlink(missing_ok=True)
            subprocess.run([program, "new", "--family", family, path.stem, str(n)], cwd=MODELS, check=True, capture_output=True)
            bench, seconds = exported(program, path)
            compiling.append(seconds)
            evaluating.append(min(nanoseconds(bench, max(20000 // n**power, 5))["ns"] for _ in range(ROUNDS)))
        cells = [n**power for n in sizes]
        shown = lambda values: ", ".join(values)
        row(
            family,
            shown(map(str, sizes)),
            shown(f"{s:.2f} s" for s in compiling),
            f"{exponent(cells, compiling):.2f}",
            shown(map(scale, evaluating)),
            f"{exponent(cells, evaluating):.2f}",
        )


BENCHES = {"links": links, "mesh": mesh, "growth": growth}

if __name__ == "__main__":
    in_environment()
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")] or list(BENCHES)
    program = halfarrow()
    for name in chosen:
        BENCHES[name](program)
