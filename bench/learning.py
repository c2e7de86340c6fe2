"""What a call of a model as a function costs, and how many steps of an environment there are in a second.

    pip install 'halfarrow[jax,gym]'; python bench/learning.py

Least of several medians, since others may use the computer.
"""

import os
import time
from pathlib import Path

import numpy as np

import halfarrow as ha

MODELS = Path(__file__).resolve().parents[1] / "models"
SHORT = "model Cart\nparam m = 2 kg, b = 3 N.s/m\ninput push : N = 1\nSe:hand(push) -> 1:v -> I:cart(m)\nv -> R:drag(b)\n"
NET = """model Net
param r[40] = [{}], u = 3
input v = 0
Se:s(u*cos(3*t) + v) -> 1:b[1]
for i in 1..40 {{ b[i] -> R:wire[i](e = r[i]*f + 0.1*f^3)
b[i] -> 0:k[i]
k[i] -> C:store[i](0.1) }}
for i in 1..39 {{ k[i] -> 1:b[i + 1] }}
""".format(", ".join(str(1 + 0.1 * i) for i in range(40)))


def took(work, seconds=0.3, rounds=5):
    """Seconds of a call."""
    work()
    medians = []
    for _ in range(rounds):
        times, end = [], time.perf_counter() + seconds
        while time.perf_counter() < end or len(times) < 3:
            begun = time.perf_counter()
            work()
            times.append(time.perf_counter() - begun)
        medians.append(np.median(times))
    return min(medians)


def functions():
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    car = ha.load(MODELS / "quarter_car" / "model.bond")
    cases = [
        ("cart, 3 samples", ha.model(SHORT), ["m", "b"], ["cart.f"], dict(to=2, every=1)),
        ("quarter car, 101 samples", car, ["ks", "b", "ms"], ["travel"], dict(to=1, every=0.01)),
        ("net, 42 parameters", ha.model(NET), ["r", "u", "v"], ["store[40].q"], dict(to=1, every=0.1)),
    ]
    print("milliseconds              simulate  call  jax  jacobian  vjp  jax grad  64 sets, each")
    for title, model, parameters, outputs, run in cases:
        f = model.function(parameters, outputs, **run)
        x, w = f.values, np.ones((len(f.t), len(f.outputs)))
        given = dict(zip(f.parameters, x))
        inputs = {name: given.pop(name) for name in list(given) if name in model.inputs}
        g, at = jax.jit(f.jax()), jnp.asarray(x)
        slope = jax.jit(jax.grad(lambda x: f.jax()(x).sum()))
        sets = np.tile(x, (64, 1))
        times = [
            took(lambda: model.simulate(**run, rtol=1e-8, record=f.outputs, parameters=given, inputs=inputs)),
            took(lambda: f(x)), took(lambda: g(at).block_until_ready()), took(lambda: f.jacobian(x)),
            took(lambda: f.vjp(x, w)), took(lambda: slope(at).block_until_ready()), took(lambda: f(sets), 1, 3) / 64,
        ]  # fmt: skip
        print(f"{title:26}", *(f"{1e3 * t:.3f}" for t in times))


def environments():
    from gymnasium.vector import SyncVectorEnv

    net = ha.model(NET)
    cases = [
        ("cart, 20 steps of 1 ms", ha.model(SHORT), ["cart.f"], {"push": (-1, 1)}, dict(step=1e-3, every=0.02)),
        ("net, 20 steps of 1 ms", net, ["store[1].q", "store[40].q"], {"v": (-1, 1)}, dict(step=1e-3, every=0.02)),
    ]
    print("actions a second           stepper  gym  SyncVectorEnv of 64  gym_vector of 64: 1 thread, all")
    for title, model, seen, actions, ask in cases:
        env = ha.gym(model, seen, actions, seen[0], **ask)
        env.reset(seed=1)
        run, action = env.run, env.action_space.high
        rates = [1 / took(lambda: run.step(20)), 1 / took(lambda: env.step(action))]
        sync = SyncVectorEnv([lambda: ha.gym(model, seen, actions, seen[0], **ask)] * 64)
        several = [ha.gym_vector(model, 64, seen, actions, seen[0], **ask, threads=n) for n in (1, os.cpu_count())]
        for envs in (sync, *several):
            envs.reset(seed=1)
            every = np.tile(action, (64, 1))
            rates.append(64 / took(lambda: envs.step(every)))
        print(f"{title:26}", *(f"{rate:,.0f}" for rate in rates))


if __name__ == "__main__":
    environments()
    functions()
