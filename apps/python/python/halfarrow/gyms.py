"""Models as environments of Gymnasium, in which something learns to act."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from ._errors import RunError, UnknownNameError, UsageError, needed, unknown
from ._words import hint
from .stepper import Stepper

if TYPE_CHECKING:
    import gymnasium
    from gymnasium.vector import VectorEnv

    from .model import FixedMethod, Model, Value

    _Env: TypeAlias = gymnasium.Env[Any, Any]
    _VectorEnv: TypeAlias = VectorEnv[Any, Any, Any]
else:
    try:
        import gymnasium
        from gymnasium.vector import VectorEnv as _VectorEnv

        _Env = gymnasium.Env
    except ImportError:
        gymnasium, _Env, _VectorEnv = None, object, object

Observations: TypeAlias = Sequence[str] | Mapping[str, tuple[float, float]]
"""What is observed: names, or ranges by name."""

Actions: TypeAlias = Mapping[str, tuple[float, float] | Sequence[float]]
"""What is acted on: by name a range, a tuple of two numbers, or a list of the values that can be chosen."""

Reward: TypeAlias = str | Callable[[Stepper, Any], float]
"""A variable, or a function of the run and the action."""

Sampler: TypeAlias = "Callable[[np.random.Generator], Mapping[str, Any]] | Mapping[str, Any]"
"""Values at the begin of an episode: by name a number, a text with a unit or a range; or a function of a random generator that
gives numbers by name."""


def gym(
    model: Model,
    observations: Observations,
    actions: Actions,
    reward: Reward,
    *,
    step: float = 1e-3,
    every: float | None = None,
    to: float | None = None,
    method: FixedMethod = "rk4",
    start: Literal["given", "equilibrium"] = "given",
    reset: Sampler | None = None,
    terminated: Callable[[Stepper], bool] | None = None,
    dtype: type[np.floating[Any]] = np.float32,
    parameters: Mapping[str, Value] | None = None,
    **values: Any,
) -> Environment:
    """A model as an environment of Gymnasium: a ``gymnasium.Env`` on a stepper.

    Args:
        model: The model.
        observations: Variables, or parameters, that are observed: names, or by name the range within which they are, in
            declared units. Ranges are what the space says; what is observed is never cut down to them.
        actions: Inputs and parameters that are set: by name a range ``(least, greatest)``, or a list of the values that can be
            chosen; inputs in declared units, parameters in SI units. All ranges: a ``Box``; one list: ``Discrete``; several:
            ``MultiDiscrete``.
        reward: A variable, whose value at the end of a step is the reward; or a function of the run, a ``Stepper``, and the
            action, which gives a number.
        step: The length of a step of the method in s.
        every: Time between actions in s, a multiple of it; nothing: each step.
        to: Time after which an episode is truncated, in s; nothing: never.
        method, start, parameters, values: As in ``Model.stepper``.
        reset: What begins at random: by the names of parameters, inputs and start values such as ``mass.f(0)`` a range, all
            values between equally likely, or one value; or a function of a ``numpy.random.Generator`` that gives values by
            name. ``env.reset(options={"m": 2.0})`` comes before it.
        terminated: A function of the run that says whether an episode has come to its end.
        dtype: Of observations, and of actions in a ``Box``.

    Returns:
        The environment. ``env.run`` is the stepper; ``info["t"]`` the time in s.

    Raises:
        UnknownNameError: there is nothing of a name.
        UsageError: Gymnasium is not installed, or something is asked that cannot be.

    Its ``step`` raises ``RunError`` where the run stops, and ``UsageError`` for an action that is not in the space. Runs by
    steps are not audited, as those of ``simulate`` are: look at one of these with the same step first.

    >>> import halfarrow as ha
    >>> cart = ha.model("model Cart\\ninput push : N = 0\\nSe:hand(push) -> 1:v -> I:cart(2 kg)\\noutput speed = cart.f : m/s\\n")
    >>> env = ha.gym(
    ...     cart, {"speed": (-10, 10)}, {"push": (-1, 1)}, lambda run, action: -(run["speed"] - 1) ** 2,
    ...     step=1e-2, every=0.1, to=1, reset={"cart.f(0)": (-1, 1)},
    ... )
    >>> seen, info = env.reset(seed=1, options={"cart.f(0)": 0.0})
    >>> seen, reward, ended, cut, info = env.step(env.action_space.high)
    >>> seen.round(3), round(reward, 4), info
    (array([0.05], dtype=float32), -0.9025, {'t': 0.1})
    """
    return Environment(
        _Task(model, observations, actions, reward, step, every, to, method, start, reset, terminated, dtype, parameters, values)
    )


def gym_vector(
    model: Model,
    n: int,
    observations: Observations,
    actions: Actions,
    reward: Reward,
    *,
    threads: int = 1,
    step: float = 1e-3,
    every: float | None = None,
    to: float | None = None,
    method: FixedMethod = "rk4",
    start: Literal["given", "equilibrium"] = "given",
    reset: Sampler | None = None,
    terminated: Callable[[Stepper], bool] | None = None,
    dtype: type[np.floating[Any]] = np.float32,
    parameters: Mapping[str, Value] | None = None,
    **values: Any,
) -> Environments:
    """Several environments of one model at once: a ``gymnasium.vector.VectorEnv``. One that has come to its end begins anew
    with the next step, whose action it leaves aside (``AutoresetMode.NEXT_STEP``).

    Args:
        n: How many.
        threads: Threads that step them. More than one pays where what is computed between two actions takes longer than some
            hundred microseconds for all of them; results are the same.
        model, observations, actions, reward, step, every, to, method, start, reset, terminated, dtype, parameters, values: As in
            ``gym``.

    Returns:
        The environments. ``envs.runs`` are the steppers. A seed of ``reset`` is that of the first one; the others have those
        that follow.

    Raises:
        UnknownNameError, UsageError: as in ``gym``.

    >>> import halfarrow as ha
    >>> cart = ha.model("model Cart\\ninput push : N = 0\\nSe:hand(push) -> 1:v -> I:cart(2 kg)\\noutput speed = cart.f : m/s\\n")
    >>> envs = ha.gym_vector(cart, 3, ["speed"], {"push": [-1.0, 0.0, 1.0]}, "speed", step=1e-2, every=0.1)
    >>> seen, info = envs.reset(seed=1)
    >>> seen, rewards, ended, cut, info = envs.step([0, 1, 2])
    >>> rewards.round(3)
    array([-0.05,  0.  ,  0.05])
    """
    task = _Task(
        model, observations, actions, reward, step, every, to, method, start, reset, terminated, dtype, parameters, values
    )
    return Environments(task, n, threads)


class Environment(_Env):
    """A model as a ``gymnasium.Env``: ``halfarrow.gym`` makes one."""

    metadata = {"render_modes": []}
    render_mode = None

    def __init__(self, task: _Task) -> None:
        self._task = task
        self.observation_space = task.observation_space
        self.action_space = task.action_space
        self._taken = 0
        self._run: Stepper | None = None

    @property
    def run(self) -> Stepper:
        """The run of this episode."""
        if self._run is None:
            raise UsageError("no episode has begun: call `reset` first")
        return self._run

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Of the random generator.
            options: Values of parameters, inputs and start values by name, which come before those of the sampler.

        Returns:
            What is observed, and ``{"t": 0.0}``.
        """
        super().reset(seed=seed)
        self._run = self._task.begin(self.np_random, options or {})
        self._taken = 0
        return self._task.look(self._run), {"t": self._run.t}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Acts, and goes on up to the next action.

        Returns:
            What is observed, the reward, whether the episode has come to its end, whether it is cut off at ``to``, and
            ``{"t": time in s}``.

        Raises:
            RunError: the run stops.
            UsageError: the action is not in the space.
        """
        task, run = self._task, self.run
        task.act(run, task.checked(action))
        run.step(task.steps)
        self._taken += 1
        cut = task.limit is not None and self._taken >= task.limit
        return task.look(run), task.rewarded(run, action), task.ended(run), cut, {"t": run.t}

    def close(self) -> None:
        """Gives its memory back."""
        if self._run is not None:
            self._run.close()

    def __repr__(self) -> str:
        return f"<Environment of {self._task.model.name}>"

    __str__ = __repr__


class Environments(_VectorEnv):
    """A model as a ``gymnasium.vector.VectorEnv``: ``halfarrow.gym_vector`` makes one."""

    def __init__(self, task: _Task, n: int, threads: int) -> None:
        from gymnasium.vector import AutoresetMode
        from gymnasium.vector.utils import batch_space

        for name, value in (("n", n), ("threads", threads)):
            if value < 1:
                raise UsageError(f"{name} is {value}: it has to be at least 1")
        self.metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
        self._task = task
        self.num_envs = n
        self.single_observation_space, self.single_action_space = task.observation_space, task.action_space
        self.observation_space = batch_space(task.observation_space, n)
        self.action_space = batch_space(task.action_space, n)
        self._rngs = [np.random.default_rng() for _ in range(n)]
        self._runs: list[Stepper | None] = [None] * n
        self._taken = np.zeros(n, dtype=np.int64)
        self._over = np.zeros(n, dtype=np.bool_)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._parts = np.array_split(np.arange(n), min(n, threads))

    @property
    def runs(self) -> list[Stepper]:
        """The runs of their episodes."""
        return [self._at(i) for i in range(self.num_envs)]

    def _at(self, i: int) -> Stepper:
        run = self._runs[i]
        if run is None:
            raise UsageError("no episode has begun: call `reset` first")
        return run

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode in each of them.

        Args:
            seed: Of the first one, the others have those that follow; or one for each.
            options: As in ``Environment.reset``, for all of them; ``reset_mask``, booleans of the shape ``(n,)``: which of them
                begin.

        Returns:
            What is observed, of the shape ``(n, observations)``, and ``{"t": array}``.
        """
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs)), dtype=np.bool_)
        seeds = [seed + i if isinstance(seed, int) else None for i in range(self.num_envs)]
        if seed is not None and not isinstance(seed, int):
            seeds = list(seed)
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,):
            raise UsageError(f"there are {self.num_envs} environments: give a seed, and in `reset_mask` a boolean, for each")
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._rngs[i] = np.random.default_rng(seeds[i])
            self._begin(i, options)
        return self._look(), self._info()

    def _begin(self, i: int, options: Mapping[str, Any]) -> None:
        self._runs[i] = self._task.begin(self._rngs[i], options)
        self._taken[i], self._over[i] = 0, False

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Acts in each of them, and goes on up to the next action.

        Args:
            actions: An action for each.

        Returns:
            What is observed, ``(n, observations)``; rewards, ends and cuts, each of the shape ``(n,)``; and ``{"t": array}``.

        Raises:
            RunError: a run stops, with the number of its environment from 0.
            UsageError: an action is not in the space.
        """
        if len(actions) != self.num_envs:
            raise UsageError(f"there are {self.num_envs} environments, and {len(actions)} actions")
        task, n = self._task, self.num_envs
        again = self._over.copy()
        checked = [None if again[i] else task.checked(actions[i]) for i in range(n)]
        for i in range(n):
            if again[i]:
                self._begin(i, {})
            else:
                task.act(self._at(i), checked[i])
        self._advance(again)
        rewards, ends = np.zeros(n), np.zeros(n, dtype=np.bool_)
        for i in np.flatnonzero(~again).tolist():
            self._taken[i] += 1
            rewards[i] = task.rewarded(self._at(i), actions[i])
            ends[i] = task.ended(self._at(i))
        cuts = np.zeros(n, dtype=np.bool_) if task.limit is None else (self._taken >= task.limit) & ~again
        self._over = ends | cuts
        return self._look(), rewards, ends, cuts, self._info()

    def _advance(self, again: npt.NDArray[np.bool_]) -> None:
        steps = self._task.steps

        def part(numbers: Any) -> None:
            for i in numbers.tolist():
                if not again[i]:
                    try:
                        self._at(i).step(steps)
                    except RunError as why:
                        raise RunError(f"environment {i}: {why}", why.result) from why

        if self._pool is None:
            part(self._parts[0])
        else:
            for future in [self._pool.submit(part, numbers) for numbers in self._parts]:
                future.result()

    def _look(self) -> Any:
        return np.stack([self._task.look(self._at(i)) for i in range(self.num_envs)])

    def _info(self) -> dict[str, Any]:
        t = np.array([self._at(i).t for i in range(self.num_envs)])
        return {"t": t, "_t": np.ones(self.num_envs, dtype=np.bool_)}

    def close_extras(self, **_: Any) -> None:
        """Gives their memory back."""
        if self._pool is not None:
            self._pool.shutdown()
        for run in self._runs:
            if run is not None:
                run.close()

    def __repr__(self) -> str:
        return f"<{self.num_envs} Environments of {self._task.model.name}>"


class _Task:
    """What is observed, acted on and rewarded."""

    def __init__(
        self, model: Model, observations: Observations, actions: Actions, reward: Reward, step: float, every: float | None,
        to: float | None, method: FixedMethod, start: Literal["given", "equilibrium"], reset: Sampler | None,
        terminated: Callable[[Stepper], bool] | None, dtype: type[np.floating[Any]], parameters: Mapping[str, Value] | None,
        values: Mapping[str, Any],
    ) -> None:  # fmt: skip
        if gymnasium is None:
            raise needed("gymnasium", "gym", "an environment")
        names = model._names
        for name in values:
            if name not in names.inputs and not names.is_parameter(name):
                options = gym_vector.__code__.co_varnames[: gym_vector.__code__.co_argcount + gym_vector.__code__.co_kwonlyargcount]
                near = hint(name, [*(own for own, p in names.parameters.items() if not p.constant), *names.inputs, *options])
                raise UnknownNameError(f"`{name}` is no parameter or input of {model.name}, and no argument of gym{near}")
        set_values, given = model._split(values, parameters, None)
        self.model = model
        self._run = {"step": step, "method": method, "start": start}
        self._fixed = {**dict(set_values), **given}
        self.steps = _multiple("every", every, "step", step)
        self.limit = None if to is None else _multiple("to", to, "every", every or step)
        readable = [*names.variables, *names.parameters]
        self._observed = [observations] if isinstance(observations, str) else list(observations)
        for name in self._observed:
            if name not in readable:
                raise unknown("variable", name, readable)
        if isinstance(reward, str) and reward not in readable:
            raise unknown("variable", reward, readable)
        self._reward, self._terminated, self._dtype = reward, terminated, dtype
        ranges = [_range(n, observations[n]) if isinstance(observations, Mapping) else (-np.inf, np.inf) for n in self._observed]
        self.observation_space: Any = _box(ranges, dtype)
        settable = [*names.inputs, *(name for name, p in names.parameters.items() if not p.constant)]
        for name in actions:
            if name not in settable:
                raise unknown("input or parameter", name, settable)
        self._acted = list(actions)
        self._choices: list[list[float]] | None = None
        self.action_space: Any = self._actions(actions)
        self._sampler = reset
        self._started: dict[tuple[str, ...], Model] = {(): model}
        # What the sampler gives is looked at now.
        self.begin(np.random.default_rng(0), {}).close()

    def _actions(self, actions: Actions) -> Any:
        """The space of actions."""
        if not actions:
            raise UsageError('nothing is acted on: give actions, as in {"push": (-1.0, 1.0)}')
        lists = {name: given for name, given in actions.items() if not isinstance(given, tuple)}
        if not lists:
            ranges = [_range(name, given) for name, given in actions.items()]
            if not np.isfinite(ranges).all():
                raise UsageError("a range of an action is not finite")
            return _box(ranges, self._dtype)
        if len(lists) < len(actions):
            raise UsageError("some actions have ranges, some lists of values: give all ranges as tuples, or all lists")
        self._choices = [[float(value) for value in given] for given in lists.values()]
        if not all(self._choices):
            raise UsageError("an action has no values that could be chosen")
        counts = [len(given) for given in self._choices]
        return gymnasium.spaces.Discrete(counts[0]) if len(counts) == 1 else gymnasium.spaces.MultiDiscrete(counts)

    def begin(self, rng: np.random.Generator, options: Mapping[str, Any]) -> Stepper:
        """The run of an episode."""
        values = {**self._fixed, **_sampled(self._sampler, rng), **options}
        starts = tuple(sorted(name[: -len("(0)")] for name in values if name.endswith("(0)")))
        model = self._started.get(starts)
        if model is None:
            known = self.model._names
            for name in starts:
                if name not in known.variables:
                    raise unknown("start value", f"{name}(0)", [f"{state}(0)" for state in known.states])
            model = self._started[starts] = type(self.model)(self.model._core.with_starts(list(starts)))
        inputs = {name: value for name, value in values.items() if name in model.inputs}
        parameters = {name: value for name, value in values.items() if name not in inputs}
        return model.stepper(**self._run, parameters=parameters, **inputs)  # type: ignore[arg-type]

    def checked(self, action: Any) -> list[float]:
        """The values of an action."""
        if self._choices is not None:
            numbers = np.atleast_1d(np.asarray(action))
            if numbers.shape != (len(self._choices),) or not np.issubdtype(numbers.dtype, np.integer):
                raise UsageError(f"the action is {action!r}: it has to be in {self.action_space}")
            for number, given, name in zip(numbers.tolist(), self._choices, self._acted):
                if not 0 <= number < len(given):
                    raise UsageError(f"the action for `{name}` is {number}: there are {len(given)} values, from 0 on")
            return [given[number] for number, given in zip(numbers.tolist(), self._choices)]
        values = np.asarray(action, dtype=self._dtype)
        low, high = self.action_space.low, self.action_space.high
        if values.shape != low.shape:
            raise UsageError(f"the action has the shape {values.shape}: it is {', '.join(self._acted)}, {low.shape}")
        inside = (values >= low) & (values <= high)
        if not inside.all():
            i = int(np.flatnonzero(~inside)[0])
            raise UsageError(
                f"the action for `{self._acted[i]}` is {values[i]:g}, not between {low[i]:g} and {high[i]:g}: cut it down "
                "before, as `gymnasium.wrappers.ClipAction` does"
            )
        return [float(value) for value in values]

    def act(self, run: Stepper, values: Sequence[float] | None) -> None:
        for name, value in zip(self._acted, values or ()):
            run[name] = value

    def look(self, run: Stepper) -> Any:
        return np.array([run[name] for name in self._observed], dtype=self._dtype)

    def rewarded(self, run: Stepper, action: Any) -> float:
        return run[self._reward] if isinstance(self._reward, str) else float(self._reward(run, action))

    def ended(self, run: Stepper) -> bool:
        return self._terminated is not None and bool(self._terminated(run))


def _sampled(sampler: Sampler | None, rng: np.random.Generator) -> dict[str, Any]:
    if sampler is None:
        return {}
    if isinstance(sampler, Mapping):
        return {name: rng.uniform(*_range(name, given)) if isinstance(given, tuple) else given for name, given in sampler.items()}
    given = sampler(rng)
    if not isinstance(given, Mapping):
        raise UsageError(f"the function that samples has given {given!r}: it has to give values by name")
    return dict(given)


def _range(name: str, given: Any) -> tuple[float, float]:
    try:
        least, greatest = (float(value) for value in given)
    except (TypeError, ValueError):
        raise UsageError(f"`{name}` is given {given!r}: give a range of two numbers, as in (-1.0, 1.0)") from None
    if not least < greatest:
        raise UsageError(f"`{name}` is given the range {least:g} to {greatest:g}: the first has to be below the second")
    return least, greatest


def _box(ranges: Sequence[tuple[float, float]], dtype: type[np.floating[Any]]) -> Any:
    bounds = np.array(ranges, dtype=np.float64).reshape(-1, 2).astype(dtype)
    return gymnasium.spaces.Box(bounds[:, 0], bounds[:, 1], dtype=dtype)


def _multiple(name: str, long: float | None, of: str, short: float) -> int:
    """How often one time goes into another."""
    if long is None:
        return 1
    count = round(long / short) if short > 0 else 0
    if count < 1 or abs(long / short - count) > 1e-9 * count:
        raise UsageError(f"{name} is {long:g}: it has to be a multiple of {of}, which is {short:g}")
    return count
