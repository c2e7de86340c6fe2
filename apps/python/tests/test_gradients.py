"""Derivatives of one number by many parameters."""

import numpy as np
import pytest
from scipy.optimize import minimize

import halfarrow as ha

NET = """model Net
param r[40] = [{}], u = 3
Se:s(u*cos(3*t)) -> 1:b[1]
for i in 1..40 {{ b[i] -> R:wire[i](e = r[i]*f + 0.1*f^3)
b[i] -> 0:k[i]
k[i] -> C:store[i](0.1) }}
for i in 1..39 {{ k[i] -> 1:b[i + 1] }}
""".format(", ".join(str(1 + 0.1 * i) for i in range(40)))


def test_it_is_that_of_sensitivities() -> None:
    net = ha.model(NET)
    t = np.linspace(0.1, 1, 10)
    weights = np.cos(5 * t)
    g = net.gradient({"store[3].q": weights, "wire[2].f": 2 * weights}, to=1, at=t, rtol=1e-9)
    assert len(g) == 41 and g.units["u"] == ""
    by = ["r[1]", "r[40]", "u"]
    s = net.sensitivities(by, to=1, at=t, rtol=1e-9, record=["store[3].q", "wire[2].f"])
    for name in by:
        expected = s["store[3].q", name] @ weights + 2 * s["wire[2].f", name] @ weights
        assert g[name] == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert g.value == pytest.approx(s.result["store[3].q"] @ weights + 2 * s.result["wire[2].f"] @ weights, rel=1e-8)


def test_a_function_says_what_it_is_of() -> None:
    net = ha.model(NET)

    def misfit(run: ha.Recorded) -> tuple[float, dict[str, np.ndarray]]:
        off = run["store[1].q"] - np.sin(run["t"])
        return 0.5 * float(off @ off), {"store[1].q": off}

    g = net.gradient(misfit, to=1, by=["u", "r[1]"], every=0.1, rtol=1e-9)
    for name, value in [("u", 3.0), ("r[1]", 1.0)]:
        more, less = (
            net.gradient(misfit, to=1, by=[], every=0.1, rtol=1e-11, parameters={name: value + h}).value
            for h in (1e-5, -1e-5)
        )
        assert g[name] == pytest.approx((more - less) / 2e-5, rel=1e-6)
    text = repr(g)
    assert text.splitlines()[1].split() == ["by", "derivative", "unit", "of", "1", "%"]
    assert "<table>" in g._repr_html_()
    assert list(g.to_pandas().index) == ["u", "r[1]"]
    assert g.array().shape == (2,) and g.at["u"] == 3.0


def test_a_design_is_found_by_scipy() -> None:
    drop = ha.model("model Drop\nparam m = 2 kg, b = 1\nSe:w(10*m) -> 1:j -> I:mass(m)\nj -> R:air(b)\n")

    # The drag that makes the mean speed 4 m/s in 3 s.
    def cost(b: np.ndarray) -> tuple[float, np.ndarray]:
        g = drop.gradient("mean(mass.f)", to=3, by="b", every=0.01, rtol=1e-9, b=b[0])
        off = g.value - 4
        return off**2, 2 * off * g.array()

    found = minimize(cost, [1.0], jac=True, method="BFGS", tol=1e-10)
    b = found.x[0]
    # 20/b (1 - 2/(3 b) (1 - exp(-3 b / 2))) = 4, but for straight lines between samples.
    assert 20 / b * (1 - 2 / (3 * b) * (1 - np.exp(-1.5 * b))) == pytest.approx(4, abs=1e-4)


def test_what_is_wrong_is_told() -> None:
    drop = ha.model("model Drop\nparam m = 2 kg\nSe:w(10) -> I:mass(m)\n")
    with pytest.raises(ha.UnknownNameError, match="mass.f"):
        drop.gradient("final(mas.f)", to=1)
    with pytest.raises(ha.UsageError, match="time_of_max has no derivative"):
        drop.gradient("time_of_max(mass.f)", to=1)
    with pytest.raises(ha.UsageError, match="nothing that can be kept"):
        drop.gradient("most(mass.f)", to=1)
    with pytest.raises(ha.UsageError, match="shape"):
        drop.gradient({"mass.f": np.ones(3)}, to=1, every=0.1)
    with pytest.raises(ha.UsageError, match="a number and its derivatives"):
        drop.gradient(lambda run: 3.0, to=1)  # type: ignore[arg-type, return-value]
    with pytest.raises(ZeroDivisionError):
        drop.gradient(lambda run: (1 / 0, {}), to=1)
    with pytest.raises(ha.UsageError, match="did you mean `mas`"):
        ha.model("model D\nparam mas = 2\nSe:w(10) -> I:m(mas)\n").gradient("final(m.f)", to=1, by="mass")
    with pytest.raises(ha.UnknownNameError, match="mass.f"):
        drop.gradient(lambda run: (0.0, {"mass.g": run["t"]}), to=1)
