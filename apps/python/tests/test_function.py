"""A model as a differentiable function."""

from __future__ import annotations

import pickle
import threading
import time
from typing import Any

import mpmath
import numpy as np
import pytest

import halfarrow as ha
from conftest import MODELS

CART = """model Cart
param m = 2 kg, b = 3 N.s/m
input push : kN = 0
Se:hand(push) -> 1:v -> I:cart(m)
v -> R:drag(b)
output speed = cart.f : km/h
"""
T = [0.5, 1.25, 2.0]
AT = np.array([2.0, 3.0, 0.01, 0.5])
GROWING = "model M\nparam a = 1\nstate x' = a*x^2 from 1\nSe:s(x) -> R:r(1)\n"


def cart(**options: Any) -> ha.Function:
    options = {"rtol": 1e-11, **options}
    return ha.model(CART).function(["m", "b", "push", "cart.f(0)"], ["cart.f", "speed"], to=2, at=T, **options)


def fixed() -> ha.Function:
    """Steps of fixed length, whose derivatives are exact."""
    return cart(method="rk4", step=0.05)


def speed(t: float, m: Any, b: Any, push: Any, f0: Any) -> Any:
    """Of a cart with drag under a constant force."""
    rest = 1000 * push / b
    return rest + (f0 - rest) * mpmath.exp(-b * t / m)


def exact(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and derivatives of 30 digits."""
    with mpmath.workdps(30):
        value = [float(speed(t, *map(mpmath.mpf, x.tolist()))) for t in T]
        slopes = [
            [
                float(mpmath.diff(lambda *p, t=t: speed(t, *p), tuple(x.tolist()), n=tuple(int(i == k) for i in range(4))))
                for k in range(4)
            ]
            for t in T
        ]
    # m/s, and km/h.
    return np.outer(value, [1, 3.6]), np.stack([np.array(slopes), 3.6 * np.array(slopes)], axis=1)


def test_against_the_closed_form() -> None:
    f, (value, slopes) = cart(), exact(AT)
    assert f.values.tolist() == [2.0, 3.0, 0.0, 0.0]
    assert f.parameter_units == {"m": "kg", "b": "N.s/m", "push": "kN", "cart.f(0)": "m/s"}
    assert f.units == {"cart.f": "m/s", "speed": "km/h"}
    np.testing.assert_allclose(f(AT), value, rtol=1e-9)
    np.testing.assert_allclose(f.jacobian(AT), slopes, rtol=1e-7)
    v, w = np.array([0.3, -1.0, 0.0, 2.0]), np.arange(6.0).reshape(3, 2) - 2
    np.testing.assert_allclose(f.jvp(AT, v), slopes @ v, rtol=1e-7)
    np.testing.assert_allclose(f.vjp(AT, w), np.einsum("so,sop->p", w, slopes), rtol=1e-7)
    turned = ha.model(CART).function(["push", "m"], ["speed", "cart.f"], to=2, at=T, rtol=1e-11, b=3.0)
    at = AT[[2, 0]]
    known = exact(np.array([2.0, 3.0, 0.01, 0.0]))[1][:, ::-1][..., [2, 0]]
    np.testing.assert_allclose(turned.jacobian(at), known, rtol=1e-7)
    np.testing.assert_allclose(turned.vjp(at, w), np.einsum("so,sop->p", w, known), rtol=1e-7)
    assert f.jvp(AT, np.zeros(4)).tolist() == np.zeros((3, 2)).tolist()


def test_sets() -> None:
    f = fixed()
    sets = AT * np.linspace(0.5, 2, 6).reshape(2, 3, 1)
    value, slopes = f(sets), f.jacobian(sets)
    assert value.shape == (2, 3, 3, 2) and slopes.shape == (2, 3, 3, 2, 4)
    for i in np.ndindex(2, 3):
        np.testing.assert_array_equal(value[i], f(sets[i]))
    weights = np.random.default_rng(1).normal(size=(7, 2, 3, 3, 2))
    # Seven weights for each of the sets: sensitivities; one: the adjoint.
    many, one = f.vjp(sets, weights), f.vjp(sets, weights[0])
    np.testing.assert_allclose(many[0], one, rtol=1e-9)
    np.testing.assert_allclose(many, np.einsum("kabso,absop->kabp", weights, slopes), rtol=1e-9)
    weights[2, 0, 0, 0, 0] = np.nan
    holes = np.isnan(f.vjp(sets, weights))
    assert holes[2, 0, 0].all() and holes.sum() == 4
    assert f(np.zeros((0, 4))).shape == (0, 3, 2) and f.vjp(np.zeros((0, 4)), np.zeros((0, 3, 2))).shape == (0, 4)


def test_float32_is_computed_in_float64() -> None:
    f, x = fixed(), AT.astype(np.float32)
    assert f(x).dtype == np.float64
    np.testing.assert_array_equal(f(x), f(x.astype(np.float64)))


def test_arrays_and_samples() -> None:
    m = ha.model("model M\nparam k[2] = [1, 2], m = 1\n1:v -> I:mass(m, f0 = 1)\nfor i in 1..2 { v -> C:s[i](k = k[i]) }\n")
    f = m.function("k", "s[1].q", to=1, every=0.3)
    assert f.parameters == ["k[1]", "k[2]"] and f.t.tolist() == pytest.approx([0, 0.3, 0.6, 0.9, 1.0])
    omega = np.sqrt(3.0)
    np.testing.assert_allclose(f(f.values)[:, 0], np.sin(omega * f.t) / omega, atol=1e-7)
    for options in [dict(at=[0.25, 0.5]), dict(every=0.25), dict(every=1 / 3), dict(every=0.1, method="rk4", step=1e-2)]:
        f = m.function("k", "s[1].q", to=1, **options)
        assert len(f(f.values)) == len(f.t) and f.t[-1] == pytest.approx(1)


def test_inputs_over_time_and_other_parameters() -> None:
    calls = []

    def push(t: float) -> float:
        calls.append(t)
        return 0.001 * t

    f = ha.model(CART).function("m", "cart.f", to=1, every=0.5, b=0.0, push=push)
    called = len(calls)
    # A force that grows by 1 N a second on a mass without drag.
    np.testing.assert_allclose(f([[2.0], [4.0]])[..., -1, 0], [0.25, 0.125], rtol=1e-6)
    assert len(calls) == called


def test_what_follows_from_what_is_varied() -> None:
    m = ha.model(
        "model M\nparam k = 2, m = 1, q0 = k/4, b = 3*k\ninput push : N = 0.3*k\nSe:hand(push) -> 1:v -> I:mass(m)\n"
        "v -> C:spring(k = k, q0 = q0)\nv -> R:drag(b)\n"
    )
    run: dict[str, Any] = dict(to=1, every=0.5, method="rk4", step=1e-2)
    by_name = m.function(["k", "b", "q0", "push"], "spring.q", **run)
    assert by_name.values.tolist() == [2.0, 6.0, 0.5, 0.6]
    assert m.function(["b", "push", "q0"], "spring.q", **run, k=4.0).values.tolist() == [12.0, 1.2, 1.0]
    for f in (by_name, m.function("k", "spring.q", **run), m.function(["k", "spring.q(0)", "push"], "spring.q", **run)):
        x, slopes = f.values, f.jacobian(f.values)
        for i, h in enumerate(1e-5 * np.eye(len(x))):
            np.testing.assert_allclose(slopes[..., i], (f(x + h) - f(x - h)) / 2e-5, atol=1e-8)
        w = np.ones((3, 1))
        np.testing.assert_allclose(f.vjp(x, w), slopes.sum(axis=(0, 1)), rtol=1e-9, atol=1e-12)


def test_it_is_pickled() -> None:
    f = cart(inputs=None)
    again = pickle.loads(pickle.dumps(f))
    np.testing.assert_array_equal(again(AT), f(AT))
    assert repr(again) == repr(f) and "cart.f(0)" in f._repr_html_()


def test_through_an_event() -> None:
    f = ha.load(MODELS / "when_bouncing_ball" / "model.bond").function(["e", "h(0)"], "h", to=1, at=[1.0], rtol=1e-11)
    g, e, h = 9.81, 0.8, 1.0
    fall = np.sqrt(2 * h / g)
    tau = 1 - fall
    expected = [g * fall * tau, (e * g * tau - e * g * fall + g * tau) * fall / (2 * h)]
    np.testing.assert_allclose(f.vjp([e, h], [[1.0]]), expected, rtol=1e-8)


def test_what_is_wrong_is_told() -> None:
    m = ha.model(CART)
    for parameters, nearest in [("mm", "m"), ("pusj", "push"), (["m", "cart.g(0)"], "cart.f")]:
        with pytest.raises(ha.UsageError, match=f"{nearest}"):
            m.function(parameters, "speed", to=1, every=1)
    with pytest.raises(ha.UnknownNameError, match="did you mean `speed`"):
        m.function("m", "sped", to=1, every=1)
    with pytest.raises(ha.UnknownNameError, match="no argument of function; did you mean `every`"):
        m.function("m", "speed", to=1, evry=1)
    with pytest.raises(ha.UsageError, match="either `every` or `at`"):
        m.function("m", "speed", to=1)
    with pytest.raises(ha.UsageError, match="at has no times"):
        m.function("m", "speed", to=1, at=[])
    with pytest.raises(ha.UsageError, match="`m` is varied and given a value"):
        m.function("m", "speed", to=1, every=1, m=3)
    with pytest.raises(ha.UsageError, match="`m` stands twice"):
        m.function(["m", "m"], "speed", to=1, every=1)
    f = m.function("m", "speed", to=1, every=1)
    with pytest.raises(ha.UsageError, match="last axis is m, 1 numbers"):
        f([1.0, 2.0])
    with pytest.raises(ha.UsageError, match="samples and outputs"):
        f.vjp([1.0], [1.0])
    with pytest.raises(ha.UsageError, match="complex"):
        f([1j])
    with pytest.raises(ha.UsageError, match="cannot be taken"):
        f(["one"])
    with pytest.raises(ha.UsageError, match="NaN"):
        f([np.nan])
    with pytest.raises(ha.UsageError, match="shapes the model"):
        ha.model("model M\nparam n = 2, r = 1\nSe:s(1) -> 1:j\nfor i in 1..n { j -> R:w[i](r) }\n").function(
            "n", "s.f", to=1, every=1
        )


def test_a_run_that_fails() -> None:
    f = ha.model(GROWING).function("a", "x", to=1, every=0.5)
    assert f([0.5])[-1, 0] == pytest.approx(2.0)
    with pytest.raises(ha.RunError) as alone:
        f([2.0])
    with pytest.raises(ha.RunError, match="set 2 of 3") as among:
        f([[0.5], [2.0], [0.25]])
    assert str(alone.value) in str(among.value) and among.value.result is not None
    with pytest.raises(ha.RunError):
        f.vjp([2.0], np.ones((3, 1)))


def test_the_interpreter_is_left_to_others(long: ha.Model) -> None:
    f = long.function("w", "spring.q", to=20, every=10, method="rk4", step=1e-4, execution="bytecode")
    counted = 0

    def count() -> None:
        nonlocal counted
        while not done:
            counted += 1
            time.sleep(1e-3)

    done = False
    other = threading.Thread(target=count)
    other.start()
    f([[1.0], [1.1]])
    done = True
    other.join()
    assert counted > 5


class TestJax:
    @pytest.fixture(autouse=True)
    def _double(self) -> Any:
        jax = pytest.importorskip("jax")
        with jax.enable_x64(True):
            yield

    def test_gradients(self) -> None:
        from jax.test_util import check_grads

        check_grads(fixed().jax(), (AT,), order=1, modes=["rev"], atol=1e-6, rtol=1e-6)
        check_grads(fixed().jax("forward"), (AT,), order=1, modes=["fwd", "rev"], atol=1e-6, rtol=1e-6)

    def test_modes(self) -> None:
        import jax
        import jax.numpy as jnp

        f = fixed()
        g, x = f.jax(), jnp.asarray(AT)
        slopes = f.jacobian(AT)
        np.testing.assert_array_equal(jax.jit(g)(x), f(AT))
        np.testing.assert_allclose(jax.jacobian(g)(x), slopes, rtol=1e-9)
        np.testing.assert_allclose(jax.jit(jax.jacrev(g))(x), slopes, rtol=1e-9)
        np.testing.assert_allclose(jax.jacfwd(f.jax("forward"))(x), slopes, rtol=1e-12)
        sets = x * jnp.linspace(0.5, 2, 5)[:, None]
        np.testing.assert_array_equal(jax.jit(jax.vmap(g))(sets), f(sets))
        np.testing.assert_array_equal(g(sets), f(sets))

        def loss(x: Any, aim: Any) -> Any:
            return jnp.sum((g(x) - aim) ** 2)

        each = jax.vmap(jax.value_and_grad(loss), in_axes=(0, None))(sets, f(AT))
        residual = f(sets) - f(AT)
        np.testing.assert_allclose(each[0], (residual**2).sum(axis=(1, 2)), rtol=1e-9)
        np.testing.assert_allclose(each[1], f.vjp(sets, 2 * residual), rtol=1e-9)

    def test_float32(self) -> None:
        import jax
        import jax.numpy as jnp

        f = fixed()
        with jax.enable_x64(False):
            x = jnp.asarray(AT)
            y, slope = jax.value_and_grad(lambda x: f.jax()(x)[-1, 0])(x)
            assert x.dtype == y.dtype == slope.dtype == jnp.float32
            # Rounded before and after.
            assert float(y) == np.float32(f(np.asarray(x))[-1, 0])
            whole = jax.jit(f.jax())(jnp.array([2, 3, 0, 1]))
            assert whole.dtype == jnp.float32
        np.testing.assert_allclose(slope, f.jacobian(AT)[-1, 0], rtol=1e-5)

    def test_what_goes_wrong(self) -> None:
        import jax

        f = ha.model(GROWING).function("a", "x", to=1, every=0.5)
        for how in (f.jax(), jax.jit(f.jax()), jax.grad(lambda x: f.jax()(x)[-1, 0])):
            with pytest.raises(Exception, match="RunError"):
                np.asarray(how(np.array([2.0])))
        with pytest.raises(ha.UsageError, match="last axis is a"):
            f.jax()(np.ones(2))
        with pytest.raises(ha.UsageError, match="complex"):
            f.jax()(np.array([1j]))
        with pytest.raises(ha.UsageError, match="did you mean `forward`"):
            f.jax("foward")  # type: ignore[arg-type]
        with pytest.raises(Exception, match="custom_vjp|JVP"):
            jax.hessian(lambda x: f.jax()(x)[-1, 0])(np.array([0.5]))

    def test_large_arrays_pass(self) -> None:
        import jax
        import jax.numpy as jnp

        f = ha.model(CART).function(["m", "b"], "speed", to=2, every=2e-4, push=1.0)
        g = f.jax()
        step = jax.jit(lambda x: x - 1e-9 * jax.grad(lambda x: jnp.mean(g(x) ** 2))(x))
        x = jnp.array([2.0, 3.0])
        x = step(x)
        assert np.isfinite(x).all() and not (x == jnp.array([2.0, 3.0])).any()


class TestTorch:
    @pytest.fixture(autouse=True)
    def _there(self) -> None:
        pytest.importorskip("torch")

    def test_gradients(self) -> None:
        import torch

        x = torch.tensor(AT, requires_grad=True)
        # The third parameter is far smaller than a step of the check is good for.
        scale = torch.tensor([1.0, 1.0, 1e-3, 1.0], dtype=torch.float64)
        g = fixed().torch()
        start = (x / scale).detach().requires_grad_()
        assert torch.autograd.gradcheck(lambda y: g(y * scale), (start,), check_forward_ad=True)
        sets = torch.stack([start, 1.5 * start]).detach().requires_grad_()
        assert torch.autograd.gradcheck(lambda y: g(y * scale), (sets,))

    def test_modes(self) -> None:
        import torch

        f = fixed()
        g, x = f.torch(), torch.tensor(AT)
        slopes = f.jacobian(AT)
        np.testing.assert_allclose(torch.autograd.functional.jacobian(g, x), slopes, rtol=1e-9)
        np.testing.assert_allclose(torch.func.jacrev(g)(x), slopes, rtol=1e-9)
        np.testing.assert_allclose(torch.func.jacfwd(g)(x), slopes, rtol=1e-9)
        sets = x * torch.linspace(0.5, 2, 5, dtype=torch.float64)[:, None]
        np.testing.assert_array_equal(torch.func.vmap(g)(sets), f(sets.numpy()))
        each = torch.func.vmap(torch.func.grad(lambda x: g(x)[-1, 0]))(sets)
        np.testing.assert_allclose(each, f.jacobian(sets.numpy())[:, -1, 0], rtol=1e-9)

    def test_float32_and_faults(self) -> None:
        import torch

        x = torch.tensor(AT, dtype=torch.float32, requires_grad=True)
        f = fixed()
        y = f.torch()(x)
        y[-1, 0].backward()
        assert y.dtype == torch.float32 and x.grad is not None and x.grad.dtype == torch.float32
        np.testing.assert_allclose(x.grad, f.jacobian(AT)[-1, 0], rtol=1e-5)
        growing = ha.model(GROWING).function("a", "x", to=1, every=0.5).torch()
        with pytest.raises(ha.RunError):
            growing(torch.tensor([2.0]))
        with pytest.raises(ha.UsageError, match="complex"):
            growing(torch.tensor([1j]))
        with pytest.raises(ha.UsageError, match="second derivatives"):
            torch.autograd.functional.hessian(lambda x: growing(x)[-1, 0], torch.tensor([0.5]))
