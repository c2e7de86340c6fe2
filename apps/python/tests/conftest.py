"""Models that tests share."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import matplotlib
import pytest

import halfarrow as ha

matplotlib.use("Agg")

MODELS = Path(__file__).resolve().parents[3] / "models"

CART = """model Cart "cart with drag"
param m = 2 kg, b = 1 N.s/m
input push : N = 0
Se:hand(push) -> 1:v -> I:cart(m)
v -> R:drag(b)
output speed = cart.f : km/h
"""

# Half of a cubic law is solved by Newton at every evaluation: long runs take their time.
LONG = """model Long
param w = 1
1:v -> I:mass(1 kg, f0 = 1 m/s)
v -> C:spring(k = w^2*100 N/m)
"""

# Examples that need a library which need not be there.
OPTIONAL = {
    "halfarrow.functions.Function.jax": "jax",
    "halfarrow.functions.Function.torch": "torch",
    "halfarrow.gyms": "gymnasium",
    "halfarrow.global_sensitivity": "SALib",
    "halfarrow.model.Model.sobol": "SALib",
    "halfarrow.model.Model.morris": "SALib",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        for name, package in OPTIONAL.items():
            if item.name.startswith(name) and importlib.util.find_spec(package) is None:
                item.add_marker(pytest.mark.skip(reason=f"{package} is not installed"))
    # JAX has threads, which processes that are forked do not survive: what needs it comes last.
    items.sort(key=lambda item: "jax" in item.nodeid.lower())


@pytest.fixture(scope="session")
def car() -> ha.Model:
    return ha.load(MODELS / "quarter_car" / "model.bond")


@pytest.fixture
def cart() -> ha.Model:
    return ha.model(CART, name="cart.bond")


@pytest.fixture
def long() -> ha.Model:
    return ha.model(LONG, name="long.bond")
