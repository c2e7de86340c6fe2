#!/usr/bin/env python3
"""Stiff networks against CVODE and IDAS with sparse direct solvers. See README.md."""

import statistics
import sys
import time

from run import ROUNDS, built, in_environment, ladder_text, model, ours, row


def grid_text(n):
    """Nodes of a square net with a capacitor each, every third branch nonlinear; the source at one corner, a load at the other."""
    lines = ["model Grid", "param r = 1, c = 1e-3, g = 1", "Se:source(1) -> 1:s1 -> R:input(r)"]
    branches = 0
    for i in range(n):
        for j in range(n):
            lines.append(f"0:n{i}_{j} -> C:C{i}_{j}(c)")
            for name, far, inside in (("v", f"n{i + 1}_{j}", i + 1 < n), ("h", f"n{i}_{j + 1}", j + 1 < n)):
                if inside:
                    law = "f = g*(e + e^3)" if branches % 3 == 0 else "r"
                    branches += 1
                    lines += [f"n{i}_{j} -> 1:{name}{i}_{j} -> {far}", f"{name}{i}_{j} -> R:R{name}{i}_{j}({law})"]
    lines += ["s1 -> n0_0", f"n{n - 1}_{n - 1} -> R:load(r)"]
    return "\n".join(lines) + "\n"


TUBES = [(1, 2), (2, 3), (2, 6), (3, 4), (3, 5), (4, 5), (5, 10), (6, 5), (7, 4), (7, 8), (8, 5), (8, 10), (9, 8), (11, 9),
         (11, 12), (12, 7), (12, 8), (13, 11)]


def tubes_text():
    """Water tube system (Koren and van Beek; Test Set for IVP Solvers): 18 pipes with the law of Colebrook and White for
    the friction, which no elementary function solves, 13 nodes, buffers at two of them; 17 hours."""
    friction = "sqrt(abs(e)*d/(rho*l))"
    lines = ['model Tubes "Water tube system"',
             "param nu = 1.31e-6, g = 9.8, rho = 1e3, l = 1e3, k = 2e-4, d = 1, b = 200, rcrit = 2300",
             "param a = 0.7853981633974483*d^2, mu = nu*rho", "let hours = t/3600", "let re(v) = abs(v)*d/(nu*a)"]
    known = set()
    node = lambda n: f"n{n}" if n in known else known.add(n) or f"0:n{n}"
    turbulent = f"abs(f) - a*{friction}*(1.74 - 2*log10(2*k/d + 18.7*nu/(d*{friction})))"
    for i, j in TUBES:
        lines += [f"{node(i)} -> 1:p{i}_{j} -> {node(j)}", f"p{i}_{j} -> I:I{i}_{j}(rho*l/a)",
                  f"p{i}_{j} -> R:R{i}_{j}(0 = if re(f) > rcrit then {turbulent} else e - 32*mu*l*f/(a*d^2))"]
    lines += ["n5 -> C:buffer5(b/(rho*g), e0 = 109800)", "n8 -> C:buffer8(b/(rho*g), e0 = 109800)",
              "Sf:in1((1 - cos(exp(-hours) - 1))/200) -> n1", "Sf:in13((1 - cos(exp(-hours) - 1))/80) -> n13",
              "n10 -> Sf:out10(hours^2*(3*hours^2 - 92*hours + 720)/1e6)"]
    return "\n".join(lines) + "\n"


AMPLIFIER = """model Amplifier "Transistor amplifier (Hairer and Wanner, VII.1; Test Set for IVP Solvers)"
param ub = 6, uf = 0.026, alpha = 0.99, beta = 1e-6, r0 = 1000, r = 9000
let g(u) = beta*(exp(u/uf) - 1)
Se:signal(0.1*sin(200*pi*t)) -> 1:in -> R:R0(r0)
in -> 0:n1 -> 1:c1 -> 0:n2 -> R:R1(r)
c1 -> C:C1(1e-6, e0 = -3)
Se:b2(ub) -> 1:up2 -> n2
up2 -> R:R2(r)
0:n3 -> R:R3(r)
n3 -> C:C2(2e-6, e0 = 3)
n2 -> 1:be1 -> n3
be1 -> T1.b
0:n4 -> 1:ce1 -> n3
ce1 -> T1.c
R:T1[b, c](f.b = (1 - alpha)*g(e.b), f.c = alpha*g(e.b))
Se:b4(ub) -> 1:up4 -> n4
up4 -> R:R4(r)
n4 -> 1:c3 -> 0:n5 -> R:R5(r)
c3 -> C:C3(3e-6, e0 = 3)
Se:b5(ub) -> 1:up5 -> n5
up5 -> R:R6(r)
0:n6 -> R:R7(r)
n6 -> C:C4(4e-6, e0 = 3)
n5 -> 1:be2 -> n6
be2 -> T2.b
0:n7 -> 1:ce2 -> n6
ce2 -> T2.c
R:T2[b, c](f.b = (1 - alpha)*g(e.b), f.c = alpha*g(e.b))
Se:b7(ub) -> 1:up7 -> n7
up7 -> R:R8(r)
n7 -> 1:c5 -> 0:n8 -> R:R9(r)
c5 -> C:C5(5e-6, e0 = 6)
"""


def cvode(net, tolerance, banded=False):
    """Seconds and voltages at 1 s of a net of branches `(from, to, nonlinear)` with 1 mF at each node, rates and exact Jacobian
    in numpy and scipy; a source of 1 V and 1 ohm at the first node, 1 ohm to ground at the last one where `loaded`."""
    import numpy as np
    import scipy.sparse as sp
    from sksundae.cvode import CVODE

    nodes, branches, loaded = net
    c = 1e-3
    a, b, cubic = (np.array(column) for column in zip(*branches))
    m = len(branches)
    ends = np.r_[np.arange(m), np.arange(m)]
    drop = sp.csr_matrix((np.r_[np.ones(m), -np.ones(m)], (ends, np.r_[a, b])), shape=(m, nodes))
    gather = drop.T.tocsr()
    cubic = cubic.astype(float)
    leak = np.zeros(nodes)
    leak[0] += 1.0
    leak[-1] += float(loaded)

    def rates(t, y, yp):
        e = drop @ y
        f = e + cubic * e**3
        yp[:] = (-(gather @ f) - leak * y) / c
        yp[0] += 1.0 / c

    pattern = (abs(gather) @ abs(drop) + sp.eye(nodes)).tocsc()
    pattern.sort_indices()
    number = sp.csc_matrix((np.arange(1, pattern.nnz + 1), pattern.indices, pattern.indptr), shape=(nodes, nodes)).tocsr()
    place = lambda rows, columns: np.asarray(number[rows, columns]).ravel() - 1
    aa, bb, ab, ba, own = place(a, a), place(b, b), place(a, b), place(b, a), place(np.arange(nodes), np.arange(nodes))

    def jacobian(t, y, yp, entries):
        e = drop @ y
        g = (1 + 3 * cubic * e**2) / c
        together = np.r_[-g, -g, g, g, -leak / c]
        entries[:] = np.bincount(np.r_[aa, bb, ab, ba, own], together, pattern.nnz)

    options = dict(linsolver="sparse", sparsity=pattern, jacfn=jacobian)
    if banded:
        options = dict(linsolver="band", lband=1, uband=1)
    solver = CVODE(rates, method="BDF", rtol=tolerance, atol=1e-3 * tolerance, max_num_steps=10**6, **options)
    from_ = time.perf_counter()
    end = solver.solve(np.array([0.0, 1.0]), np.zeros(nodes))
    return time.perf_counter() - from_, end.y[-1]


def compared(name, peer, times, theirs, mine, scale, reference):
    """A line of the table: times, and the greatest error of either side, relative to the greatest value."""
    values = dict(zip(mine[-1]["names"], mine[-1]["states"]))
    size = max(abs(v) for v in reference.values())
    error = lambda found: max(abs(found[k] - v) for k, v in reference.items()) / size
    here = {k: values[k] * scale(k) for k in reference}
    there = statistics.median(times)
    seconds = statistics.median(min(m["seconds"], m["machine_seconds"]) for m in mine)
    off = f"{error(theirs):.0e}" if theirs else "does not end"
    row(name, peer, f"{there * 1e3:.1f} ms", off, f"{seconds * 1e3:.1f} ms", f"{error(here):.0e}", f"{seconds / there:.2f}")


def nets(program, chosen):
    c = 1e-3
    cases = []
    for n in (1_000, 10_000, 100_000):
        chain = (n, [(k, k + 1, False) for k in range(n - 1)], True)
        names = [f"C{k}.q" for k in range(1, n + 1)]
        cases += [(f"ladder {n}", chain, ladder_text(n), names, banded) for banded in ([True, False] if n == 1_000 else [False])]
    for n in (30, 100):
        branches = []
        for i in range(n):
            for j in range(n):
                for far, inside in (((i + 1) * n + j, i + 1 < n), (i * n + j + 1, j + 1 < n)):
                    if inside:
                        branches.append((i * n + j, far, len(branches) % 3 == 0))
        names = [f"C{i}_{j}.q" for i in range(n) for j in range(n)]
        cases.append((f"grid {n} x {n}", (n * n, branches, True), grid_text(n), names, False))
    for name, net, text, names, banded in cases:
        if chosen and not any(name.startswith(word) for word in chosen):
            continue
        path = model(name.replace(" ", "_"), text)
        times, mine = [], []
        for _ in range(1 if net[0] > 50_000 else ROUNDS):
            seconds, y = cvode(net, 1e-6, banded)
            times.append(seconds)
            mine.append(ours(program, "simulate", path, 1.0, 1e-6, 1e-9 * c))
        exact = dict(zip(names, cvode(net, 1e-10)[1]))
        kind = "CVODE, banded" if banded else "CVODE, SuperLU"
        compared(name, kind, times, dict(zip(names, y)), mine, lambda _: 1 / c, exact)


def idas(dae, start, algebraic, to, tolerance):
    """A function that runs IDAS with CasADi's sparse QR: seconds, and the states at the end."""
    import casadi as ca
    import numpy as np

    options = {"reltol": tolerance, "abstol": 1e-3 * tolerance, "max_num_steps": 10**5}
    solver = ca.integrator("peer", "idas", dae, 0.0, to, options)

    def once():
        from_ = time.perf_counter()
        try:
            end = solver(x0=start, z0=algebraic)
        except RuntimeError:  # it does not come to the end
            return time.perf_counter() - from_, None
        return time.perf_counter() - from_, np.array(end["xf"]).ravel()

    return once


def amplifier_dae():
    """Voltages of the five capacitors; of three nodes, which nothing stores."""
    import casadi as ca

    t, u, z = ca.SX.sym("t"), ca.SX.sym("u", 5), ca.SX.sym("z", 3)
    g = lambda e: 1e-6 * (ca.exp(e / 0.026) - 1)
    ub, r, alpha = 6.0, 9000.0, 0.99
    y1, y4, y7 = z[0], z[1], z[2]
    y2, y3, y5, y6, y8 = y1 - u[0], u[1], y4 - u[2], u[3], y7 - u[4]
    first, second = g(y2 - y3), g(y5 - y6)
    into = (0.1 * ca.sin(200 * ca.pi * t) - y1) / 1000.0
    up4, up7 = (ub - y4) / r - alpha * first, (ub - y7) / r - alpha * second
    rates = [into / 1e-6, (first - y3 / r) / 2e-6, up4 / 3e-6, (second - y6 / r) / 4e-6, up7 / 5e-6]
    balance = [into + (ub - 2 * y2) / r - (1 - alpha) * first, up4 + (ub - 2 * y5) / r - (1 - alpha) * second, up7 - y8 / r]
    return {"t": t, "x": u, "z": z, "ode": ca.vertcat(*rates), "alg": ca.vertcat(*balance)}, [-3.0, 3.0, 3.0, 3.0, 6.0], [0.0, 6.0, 6.0]


def tubes_dae():
    """Seven flows that all others follow from and the buffers' volumes; the square root of the friction of each pipe."""
    import casadi as ca
    import numpy as np

    nu, g, rho, l, k, d, b = 1.31e-6, 9.8, 1e3, 1e3, 2e-4, 1.0, 200.0
    a = 0.7853981633974483 * d**2
    joins = np.zeros((13, 18))
    for pipe, (i, j) in enumerate(TUBES):
        joins[i - 1, pipe], joins[j - 1, pipe] = -1.0, 1.0
    inner = [n for n in range(13) if n not in (4, 7)]
    free = np.linalg.svd(joins[inner])[2][11:].T
    t, x, s = ca.SX.sym("t"), ca.SX.sym("x", 9), ca.SX.sym("s", 18)
    hours = t / 3600
    source = ca.SX.zeros(13)
    source[0], source[12] = (1 - ca.cos(ca.exp(-hours) - 1)) / 200, (1 - ca.cos(ca.exp(-hours) - 1)) / 80
    source[9] = -(hours**2) * (3 * hours**2 - 92 * hours + 720) / 1e6
    follow = -np.linalg.pinv(joins[inner]) @ source[inner]
    flow = free @ x[:7] + follow
    # In the unit of 1 mm of water for each metre, so that both branches of a law are of like size.
    re = ca.fabs(flow) * d / (nu * a)
    laminar = 32 * nu * rho * l * flow / (a * d**2)
    turbulent = rho * l / d * s * ca.fabs(s) / a**2
    loss = ca.if_else(re > 2300, turbulent, laminar)
    law = lambda v: ca.fabs(flow) - v * (1.74 - 2 * ca.log10(2 * k / d + 18.7 * nu * a / (d * v)))
    balance = ca.if_else(re > 2300, law(ca.fmax(ca.fabs(s), 1e-12)) * ca.sign(flow) * ca.sign(s), s - flow)
    volume = x[7:]
    pressure = volume / (b / (rho * g))
    driving = -joins[[4, 7]].T @ pressure - loss
    slow = ca.jacobian(follow, t)
    ode = ca.vertcat(free.T @ (driving / (rho * l / a) - slow), joins[[4, 7]] @ flow)
    start = [0.0] * 7 + [109800 * b / (rho * g)] * 2
    return {"t": t, "x": x, "z": s, "ode": ode, "alg": balance}, start, [0.0] * 18


def small(program, name, text, dae, to, exact, ends):
    """A small network against IDAS; `ends` makes what is compared of the peer's states."""
    peer, path = idas(*dae, to, 1e-6), model(name, text)
    times, mine = [], []
    for _ in range(ROUNDS):
        seconds, x = peer()
        times.append(seconds)
        mine.append(ours(program, "simulate", path, to, 1e-6, 0))
        if x is None:
            break
    theirs = None if x is None else ends(x)
    compared(name, "IDAS, sparse QR", times, theirs, mine, lambda _: 1, exact)


# Reference solutions of the Test Set for IVP Solvers (Mazzia and Magherini), release 2.4: voltages of the nodes at 0.2 s,
# pressures of the buffers after 17 hours.
NODES = [-0.5562145012262709e-2, 3.006522471903042, 2.849958788608128, 2.926422536206241, 2.704617865010554, 2.761837778393145,
         4.770927631616772, 1.236995868091548]
BUFFERS = [0.1111268591478108e6, 0.1111270045592387e6]


def amplifier(program):
    y = [0.0, *NODES]
    voltages = [y[1] - y[2], y[3], y[4] - y[5], y[6], y[7] - y[8]]
    charges = lambda u: {f"C{k}.q": k * 1e-6 * value for k, value in enumerate(u, 1)}
    small(program, "amplifier", AMPLIFIER, amplifier_dae(), 0.2, charges(voltages), charges)


def tubes(program):
    volumes = lambda v: dict(zip(("buffer5.q", "buffer8.q"), v))
    exact = volumes([pressure * 200 / (1e3 * 9.8) for pressure in BUFFERS])
    small(program, "tubes", tubes_text(), tubes_dae(), 61200.0, exact, lambda x: volumes(x[7:]))


def main():
    chosen = sys.argv[1:]
    program = built()
    print("\nStiff networks at rtol 1e-6, medians of", ROUNDS, "rounds in turns; errors relative to the greatest value\n")
    row("network", "peer", "its time", "its error", "halfarrow", "error", "ratio")
    row(*["---"] * 7)
    for name, bench in (("amplifier", amplifier), ("tubes", tubes)):
        if not chosen or name in chosen:
            bench(program)
    nets(program, chosen)


if __name__ == "__main__":
    in_environment()
    main()
