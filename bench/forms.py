#!/usr/bin/env python3
"""What the forms cost: the tables of docs/forms.md and docs/TESTING.md, by `halfarrow compare`, one line a model.

    python3 bench/forms.py [MODEL ...]

Builds halfarrow in release. Nothing else should run on the machine meanwhile."""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ENDS = {
    "class2": 20, "class3": 5, "class4": 5, "class2_class4_one_I": 50, "class2_class4_two_I": 100, "two_class3_C": 5,
    "two_class3_CI": 5, "unity_gain": 10, "pendulum": 5, "chain_of_rings": 50, "chain_of_pendulums": 5,
}
SHOWN = ["break", "inverted", "lagrange", "stiff"]


def time(seconds):
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def row(*cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "halfarrow-cli"], cwd=ROOT, check=True)
    program = ROOT / "target/release/halfarrow"
    detail = []
    row("model", "`minimal`", "unknowns", "`break`", "unknowns", *(f"`{f}`" for f in SHOWN[1:]))
    row(*["---"] * 8)
    for model in sys.argv[1:] or ENDS:
        repeats = "3" if model == "chain_of_pendulums" else "5"
        command = [program, "compare", ROOT / f"models/{model}/model.bond", "--to", str(ENDS.get(model, 5)), "--error",
                   "1e-6", "--repeats", repeats, "--json"]
        if model == "chain_of_pendulums":
            command += ["--plot", ROOT / "docs/chain_of_pendulums.svg"]
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        rows = {r["form"]: r for r in found["rows"]}
        cells = [f"`{model}`"]
        for form in ["minimal", *SHOWN]:
            r = rows.get(form)
            # Without constraints the form of springs is the minimal one.
            if r is None or r["seconds_per_second"] is None or (form == "stiff" and r["order"] is None):
                cells += ["–"] + (["–"] if form == "break" else [])
                continue
            ratio = "" if form == "minimal" else f" ({r['times_minimal']:.1f})"
            cells.append(time(r["seconds_per_second"]) + ratio)
            if form in ("minimal", "break"):
                cells.append(f"{r['differential']} + {r['algebraic']}")
        row(*cells)
        radau = lambda f: rows[f]["seconds_by_radau"] / rows["minimal"]["seconds_by_radau"] if rows.get(f) and rows[f][
            "seconds_by_radau"] and rows["minimal"]["seconds_by_radau"] else None
        number = lambda v, shape: "–" if v is None else format(v, shape)
        worst = max((r["max_error"] for f, r in rows.items() if r["max_error"] is not None and f != "stiff"), default=None)
        reference = found["reference"] or {"confirmed_by": "–", "confirmed_to": None}
        detail.append([model, f"{found['to']:g}", rows["minimal"]["solver"], number(radau("break"), ".1f"),
                       number(radau("lagrange"), ".1f"), number(rows.get("stiff", {}).get("order"), ".2f"),
                       number(worst, ".0e"), str(reference["confirmed_by"]), number(reference["confirmed_to"], ".0e")])
    print()
    row("model", "to, s", "method of `minimal`", "`break`, all by Radau", "`lagrange`, all by Radau", "order of `stiff`",
        "disagreement", "confirmed by", "to")
    row(*["---"] * 9)
    for cells in detail:
        row(*cells)


if __name__ == "__main__":
    main()
