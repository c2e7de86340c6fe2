"""What an experiment can tell of parameters."""

from __future__ import annotations

import pytest

import halfarrow as ha

TEXT = """model S
param m = 1 kg, k1 = 10 N/m, k2 = 20 N/m, b = 1 N.s/m
input F : N = 0
Se:push(F) -> 1:v -> I:mass(m)
v -> C:s1(k = k1)
v -> C:s2(k = k2)
v -> R:d(b)
output x = s1.q : m
output held = s2.e : N
"""


def test_parallel_springs() -> None:
    """Of two springs side by side the way tells the sum alone; the force of one tells both."""
    model = ha.model(TEXT)
    found = model.identifiability(["m", "k1", "k2", "b"], "x", to=5, excite={"F": 1})
    assert found.rank == found.rank_here == 3
    assert found.identifiable == {"m": True, "k1": False, "k2": False, "b": True}
    (way,) = found.unidentified
    # Changes of 10 k1' + 20 k2' = 0.
    assert way["k1"] / way["k2"] == pytest.approx(-2, rel=2e-3)
    assert "no output tells" in repr(found) and "<table>" in found._repr_html_()
    both = model.identifiability(["m", "k1", "k2", "b"], ["x", "held"], to=5, excite={"F": 1})
    assert both.rank == 4 and all(both.identifiable.values()) and not both.unidentified


def test_without_excitation_nothing_is_told() -> None:
    found = ha.model(TEXT).identifiability(["m", "k1"], "x", to=5)
    assert found.rank == 0 and len(found.unidentified) == 2
    free = ha.model(TEXT).identifiability(["m", "k1", "b", "s1.q(0)"], "x", to=5, parameters={"k2": 1.0})
    assert free.identifiable["s1.q(0)"]


def test_known_scaling() -> None:
    """Force, mass and stiffness scale together: what a constant force tells are their quotients."""
    model = ha.model("model M\nparam m = 1, k = 4, F = 3\nSe:push(F) -> 1:v -> I:mass(m)\nv -> C:spring(k = k)\n")
    found = model.identifiability(["m", "k", "F"], ["spring.q"], to=3)
    assert found.rank == 2 and not any(found.identifiable.values())
    assert found.unidentified == [{"m": 0.577, "k": 0.577, "F": 0.577}]


def test_what_cannot_be() -> None:
    with pytest.raises(ha.UnknownNameError, match="parameter `kk`"):
        ha.model(TEXT).identifiability(["kk"], "x", to=1)
    with pytest.raises(ha.UnknownNameError, match="input `G`"):
        ha.model(TEXT).identifiability(["k1"], "x", to=1, excite={"G": 1})
    with pytest.raises(ha.UsageError, match="name parameters"):
        ha.model(TEXT).identifiability([], "x", to=1)
