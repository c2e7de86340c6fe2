"""Every model of the repository against its reference values, through Python."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import reduce
from math import gcd, lcm
from pathlib import Path

import numpy as np
import pytest

import halfarrow as ha
from conftest import MODELS

REFERENCES = sorted(MODELS.glob("*/reference.json"))


def test_there_are_references() -> None:
    assert len(REFERENCES) >= 35


def common_step(times: list[str]) -> float:
    """The longest time of which all these are multiples."""
    fractions = [Fraction(t) for t in times]
    unit = reduce(lcm, (f.denominator for f in fractions))
    return reduce(gcd, (int(f * unit) for f in fractions)) / unit


@pytest.mark.filterwarnings("ignore::halfarrow.ModelWarning")
@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.parent.name)
def test_reference_values_are_met(path: Path) -> None:
    reference = json.loads(path.read_text())
    inputs = {name: path.parent / file for name, file in reference.get("inputs", {}).items()}
    model = ha.load(path.parent / "model.bond")
    times = np.array([float(t) for t in reference["t"]])
    r = model.simulate(
        to=times[-1], every=common_step(reference["t"]), rtol=1e-12, inputs=inputs, record=list(reference["values"])
    )
    assert r.complete and r.audit.verdict == "holds"
    for name, wanted in reference["values"].items():
        wanted = np.array([float(v) for v in wanted])
        at = [int(np.argmax(np.abs(r.t - t) < 1e-9 * t)) for t in times]
        scale = max(np.abs(r[name]).max(), np.abs(wanted).max())
        assert np.abs(r[name][at] - wanted).max() <= reference["tolerance"] * scale, name
