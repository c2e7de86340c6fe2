"""Models near a point."""

from __future__ import annotations

import pickle

import control
import numpy as np
import pytest

import halfarrow as ha


def test_matrices(car: ha.Model) -> None:
    lin = car.linearize(at="equilibrium")
    assert lin.A.shape == (4, 4) and lin.B.shape == (4, 1) and lin.C.shape == (1, 4) and lin.D.shape == (1, 1)
    assert lin.states == car.states and lin.inputs == ["road"] and lin.outputs == ["travel"]
    np.testing.assert_allclose(lin.rates, 0, atol=1e-9)
    # The damper is cubic: at rest it does nothing, and nothing damps.
    np.testing.assert_allclose(np.sort(lin.poles.imag), np.sort(np.linalg.eigvals(lin.A).imag), rtol=1e-9)
    assert lin.stability == "marginal" and not lin.stable
    assert {round(mode.natural_frequency, 6) for mode in lin.modes} == {round(abs(p), 6) for p in lin.poles}
    assert "QuarterCar at the equilibrium" in repr(lin) and "<table>" in lin._repr_html_()


def test_parameters_and_inputs(cart: ha.Model) -> None:
    for m in (1, 4):
        lin = cart.linearize(m=m, outputs=["cart.f"])
        np.testing.assert_allclose(lin.A, [[-1 / m]])
        np.testing.assert_allclose(lin(2j), [[1 / (2j * m + 1)]])
    assert cart.linearize(at=2.0, push=3).x[0] == pytest.approx(3 * (1 - np.exp(-1.0)), abs=1e-8)
    assert cart.linearize(between=["hand"]).inputs == ["hand"]
    assert cart.linearize(symbolic=True).report["symbolic"]["transfer"]
    with pytest.raises(ha.UnknownNameError, match="there is no input `hnd`"):
        cart.linearize(between=["hnd"])
    with pytest.raises(ha.UsageError, match='has to be "start", "equilibrium" or a time'):
        cart.linearize(at="rest")  # type: ignore[arg-type]
    with pytest.raises(ha.UnknownNameError, match="no argument of linearize; did you mean `outputs`"):
        cart.linearize(output=["cart.f"])


def test_responses_and_control(car: ha.Model) -> None:
    lin = car.linearize()
    system = lin.to_control()
    assert isinstance(system, control.StateSpace) and system.state_labels[0] == "wheel_f"
    [response] = lin.responses()
    assert (response.input, response.output) == ("road", "travel")
    away = np.min(np.abs(response.frequencies[:, None] - lin.poles.imag), axis=1) > 1e-3
    np.testing.assert_allclose(system(1j * response.frequencies[away]), response.values[away], rtol=1e-6)
    np.testing.assert_allclose(lin(3j)[0, 0], system(3j), rtol=1e-9)


def test_a_pole_has_no_value() -> None:
    mass = ha.model("model M\ninput u = 0\nSe:a(u) -> I:m(1)\n")
    assert np.isnan(mass.linearize()(0)).all()


def test_bode(car: ha.Model) -> None:
    import matplotlib.pyplot as plt

    lin = car.linearize()
    magnitude, phase = lin.bode()
    assert len(magnitude.get_lines()) == len(phase.get_lines()) == 1
    assert lin.picture("bode").svg != lin.picture("nyquist").svg
    with pytest.raises(ha.UnknownNameError, match="did you mean `travel`"):
        lin.bode(output="travl")
    with pytest.raises(ha.UsageError, match="did you mean `nyquist`"):
        lin.picture("nyqist")
    plt.close("all")


def test_pickled(car: ha.Model) -> None:
    lin = car.linearize()
    again = pickle.loads(pickle.dumps(lin))
    assert again.A.tobytes() == lin.A.tobytes() and again(1j).tobytes() == lin(1j).tobytes()
    with pytest.raises(ha.UsageError, match="linearize the model again"):
        again.picture()
