"""Models as environments of Gymnasium."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import halfarrow as ha

gymnasium = pytest.importorskip("gymnasium")

CART = """model Cart
param m = 2 kg, b = 1 N.s/m
input push : N = 0
Se:hand(push) -> 1:v -> I:cart(m)
v -> R:drag(b)
output speed = cart.f : m/s
state x' = cart.f from 0
"""
ASK: dict[str, Any] = dict(step=1e-2, every=0.1, to=1.0)


def cart(**options: Any) -> ha.Environment:
    options = {"reset": {"cart.f(0)": (-0.5, 0.5), "m": (1.0, 3.0)}, **ASK, **options}
    return ha.gym(ha.model(CART), {"x": (-9, 9), "speed": (-9, 9)}, {"push": (-1, 1)}, lambda run, a: -run["x"] ** 2, **options)


def test_it_is_what_gymnasium_takes() -> None:
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # It is not made by a name.
        warnings.filterwarnings("ignore", message=".*spec.*")
        check_env(cart(), skip_render_check=True)
    for actions in ({"push": [-1.0, 0.0, 1.0]}, {"push": [-1.0, 1.0], "b": [0.5, 2.0]}):
        check_env(ha.gym(ha.model(CART), ["x"], actions, "x", **ASK), skip_render_check=True)


def test_it_is_the_motion_of_a_cart() -> None:
    env = cart(dtype=np.float64)
    assert env.observation_space == gymnasium.spaces.Box(-9.0, 9.0, (2,), np.float64)
    seen, info = env.reset(seed=3, options={"m": 2.0})
    f0, rest, t = seen[1], 0.5, 0.0
    assert seen[0] == 0 and abs(f0) <= 0.5 and info == {"t": 0.0}
    cut = False
    while not cut:
        seen, reward, ended, cut, info = env.step(np.array([0.5]))
        t += 0.1
        gone = rest + (f0 - rest) * np.exp(-t / 2)
        way = rest * t + (f0 - rest) * 2 * (1 - np.exp(-t / 2))
        np.testing.assert_allclose(seen, [way, gone], atol=1e-9)
        assert reward == pytest.approx(-(way**2), abs=1e-9) and not ended
        assert info["t"] == pytest.approx(t)
    assert t == pytest.approx(1.0) and env.run["m"] == 2.0


def test_seeds() -> None:
    env = cart()
    first = [env.reset(seed=7)[0][1], env.run["m"], env.reset()[0][1], env.run["m"]]
    again = [env.reset(seed=7)[0][1], env.run["m"], env.reset()[0][1], env.run["m"]]
    assert first == again and len({*first}) == 4
    assert 1.0 <= env.run["m"] <= 3.0

    def sampler(rng: np.random.Generator) -> dict[str, Any]:
        m = rng.uniform(1, 2)
        return {"m": m, "push": 0.25, "b": "2 N.s/m", "x(0)": m / 2}

    env = cart(reset=sampler)
    seen, _ = env.reset(seed=1)
    assert seen[0] == pytest.approx(env.run["m"] / 2) and env.run["b"] == 2.0 and env.run["push"] == 0.25


def test_ends_and_choices() -> None:
    env = ha.gym(
        ha.model(CART), ["x", "m"], {"push": [-1.0, 1.0], "b": [0.0, 2.0]}, "speed", terminated=lambda run: run["x"] > 0.1, **ASK
    )
    assert env.action_space == gymnasium.spaces.MultiDiscrete([2, 2])
    env.reset(seed=1)
    ended, n = False, 0
    while not ended:
        seen, reward, ended, cut, _ = env.step([1, 0])
        n += 1
    # x = t^2/4 is above 0.1 from 0.632 s on, where the speed is t/2.
    assert n == 7 and reward == pytest.approx(0.35) and not cut and seen[1] == 2.0 and env.run["b"] == 0.0
    env.close()


def test_many_at_once_are_many_alone() -> None:
    ask: dict[str, Any] = dict(dtype=np.float64, terminated=lambda run: abs(run["x"]) > 0.3)
    model = ha.model(CART)
    single = [cart(**ask) for _ in range(5)]
    several = [
        ha.gym_vector(
            model, 5, {"x": (-9, 9), "speed": (-9, 9)}, {"push": (-1, 1)}, lambda run, a: -run["x"] ** 2, threads=threads,
            reset={"cart.f(0)": (-0.5, 0.5), "m": (1.0, 3.0)}, **{**ASK, **ask},
        )
        for threads in (1, 3)
    ]  # fmt: skip
    alone = gymnasium.vector.SyncVectorEnv([lambda env=env: env for env in single])
    begun = [envs.reset(seed=11)[0] for envs in (alone, *several)]
    assert several[0].observation_space == alone.observation_space and several[0].action_space == alone.action_space
    assert begun[0].tobytes() == begun[1].tobytes() == begun[2].tobytes()
    alone.action_space.seed(2)
    over = 0
    for _ in range(40):
        actions = alone.action_space.sample()
        expected = alone.step(actions)
        over += int(expected[2].sum() + expected[3].sum())
        for envs in several:
            found = envs.step(actions)
            for one, other in zip(found[:4], expected[:4]):
                assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
            np.testing.assert_array_equal(found[4]["t"], expected[4]["t"])
    assert over > 5
    wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(several[1])
    wrapped.reset(seed=1, options={"m": 1.5})
    wrapped.step(actions)
    assert [run["m"] for run in several[1].runs] == [1.5] * 5
    before = [run.t for run in several[0].runs]
    several[0].reset(options={"reset_mask": np.array([True, False, False, False, False])})
    assert [run.t for run in several[0].runs] == [0.0, *before[1:]]
    for envs in several:
        envs.close()


def test_what_is_wrong_is_told() -> None:
    m = ha.model(CART)
    push: dict[str, Any] = {"push": (-1, 1)}
    with pytest.raises(ha.UnknownNameError, match="did you mean `speed`"):
        ha.gym(m, ["spede"], push, "x")
    with pytest.raises(ha.UnknownNameError, match="did you mean `push`"):
        ha.gym(m, ["x"], {"puhs": (-1, 1)}, "x")
    with pytest.raises(ha.UnknownNameError, match="did you mean `speed`"):
        ha.gym(m, ["x"], push, "spedd")
    with pytest.raises(ha.UnknownNameError, match="did you mean `cart.f\\(0\\)`"):
        ha.gym(m, ["x"], push, "x", reset={"cart.g(0)": (0, 1)})
    with pytest.raises(ha.UnknownNameError, match="no argument of gym; did you mean `every`"):
        ha.gym(m, ["x"], push, "x", evry=0.1)
    with pytest.raises(ha.UsageError, match="every is 0.015: it has to be a multiple of step"):
        ha.gym(m, ["x"], push, "x", step=0.01, every=0.015)
    with pytest.raises(ha.UsageError, match="give all ranges as tuples"):
        ha.gym(m, ["x"], {**push, "b": [1.0, 2.0]}, "x")
    env = ha.gym(m, ["x"], push, "x", **ASK)
    with pytest.raises(ha.UsageError, match="call `reset` first"):
        env.step([0.0])
    env.reset()
    with pytest.raises(ha.UsageError, match="the action for `push` is 2, not between -1 and 1"):
        env.step([2.0])
    with pytest.raises(ha.UsageError, match="not between"):
        env.step([np.nan])
    with pytest.raises(ha.UsageError, match="has the shape"):
        env.step(0.0)
    with pytest.raises(AttributeError, match="no attribute `?'?gims"):
        ha.gims  # type: ignore[attr-defined]


def test_a_run_that_stops() -> None:
    growing = ha.model("model M\ninput a = 1\nstate x' = a*x^2 from 1\nSe:s(x) -> R:r(1)\n")
    envs = ha.gym_vector(growing, 2, ["x"], {"a": (0.0, 1.0)}, "x", step=1e-2, every=2.0)
    envs.reset()
    with pytest.raises(ha.RunError, match="environment 1: "):
        envs.step(np.array([[0.1], [1.0]]))
