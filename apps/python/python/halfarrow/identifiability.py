"""Which parameters an experiment can tell at all, before anything is measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._errors import RunError, UsageError
from ._tables import as_html, as_text

if TYPE_CHECKING:
    from .model import Model

Array = npt.NDArray[np.float64]

# Directions that move outputs by less than this part of the greatest move are told by the errors of runs alone.
_RANK = 1e-7
# A share of a parameter in such a direction below which it takes no part.
_SHARE = 1e-3


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """What noiseless measurements of outputs tell of parameters, near their values.

    >>> import halfarrow as ha
    >>> cart = ha.model("model M\\nparam m = 2 kg, b = 1 N.s/m, F = 3 N\\nSe:push(F) -> 1:v -> I:cart(m)\\nv -> R:drag(b)\\n")
    >>> found = cart.identifiability(["m", "b", "F"], ["cart.f"], to=5)
    >>> found.rank, found.identifiable
    (2, {'m': False, 'b': False, 'F': False})
    >>> found.unidentified
    [{'m': 0.577, 'b': 0.577, 'F': 0.577}]
    """

    names: list[str]
    rank: int
    """How many combinations of parameters are told for nearly all values of them."""
    rank_here: int
    """The same at the values of the model: less where they are special ones."""
    identifiable: dict[str, bool]
    """Of each parameter whether it is told."""
    unidentified: list[dict[str, float]]
    """Relative changes of parameters, at the values of the model, that change no output together."""
    sizes: Array
    """Singular values at the values of the model, the greatest 1: small ones are told by exact measurements only."""

    def _rows(self) -> tuple[list[str], list[list[Any]]]:
        return ["parameter", "identifiable"], [[n, "yes" if known else "no"] for n, known in self.identifiable.items()]

    def __repr__(self) -> str:
        parts = [as_text(*self._rows()), f"rank {self.rank} of {len(self.names)}"]
        for way in self.unidentified:
            text = " ".join(f"{share:+.2f} {name}" for name, share in way.items())
            parts.append(f"no output tells: {text} (relative changes)")
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        return as_html(*self._rows())


def identifiability(
    model: Model,
    by: Sequence[str],
    outputs: Sequence[str],
    to: float,
    excite: Mapping[str, float],
    points: int,
    seed: int,
    options: Mapping[str, Any],
) -> Identifiability:
    """See ``Model.identifiability``."""
    by = [own for name in by for own in ([name] if name.endswith("(0)") else model._names.members(name))]
    if not by or not outputs or points < 1:
        raise UsageError("name parameters, outputs that are measured, and at least one point")
    rng = np.random.default_rng(seed)
    options = dict(options)
    inputs = {**(options.pop("inputs", None) or {}), **_rich(excite, to, rng)}
    given = dict(options.pop("parameters", None) or {})
    values = {n: float(given.get(n, model.parameters[n].value)) for n in by if n in model.parameters}
    times = np.linspace(0.0, to, 201)

    def weighed(at: Mapping[str, float]) -> Array:
        s = model.sensitivities(
            by, to, at=times, rtol=1e-11, record=list(outputs), parameters={**given, **at}, inputs=inputs, **options
        )
        blocks = []
        for name in s.names:
            spread = float(np.abs(s.result[name]).max()) or 1.0
            blocks.append(np.stack([s[name, own] * (at.get(own) or 1.0) / spread for own in by], axis=-1))
        return np.concatenate(blocks)

    here = np.linalg.svd(weighed(values))
    found = [here]
    for _ in range(points):
        moved = {name: value * float(np.exp(rng.uniform(-0.2, 0.2))) for name, value in values.items()}
        try:
            found.append(np.linalg.svd(weighed(moved)))
        except RunError:
            # The model does not run there.
            continue
    ranks = [int(np.sum(sizes > _RANK * sizes.max(initial=0.0))) for _, sizes, _ in found]
    rank = max(ranks)
    ways = found[ranks.index(rank)][2][rank:]
    told = {name: bool(np.all(np.abs(ways[:, i]) <= _SHARE)) for i, name in enumerate(by)}
    lost = [_shares(by, way) for way in here[2][ranks[0] :]]
    return Identifiability(list(by), rank, ranks[0], told, lost, here[1] / (here[1].max(initial=0.0) or 1.0))


def _shares(names: Sequence[str], way: Array) -> dict[str, float]:
    """The parameters that take part, the greatest share first and above 0; of equal ones as they were named."""
    shares = [round(float(share), 3) for share in way]
    order = sorted((i for i in range(len(names)) if abs(way[i]) > _SHARE), key=lambda i: -abs(shares[i]))
    sign = -1.0 if shares[order[0]] < 0 else 1.0
    return {names[i]: sign * shares[i] for i in order}


def _rich(excite: Mapping[str, float], to: float, rng: np.random.Generator) -> dict[str, Any]:
    """Sums of sines whose periods have no common one, of these amplitudes."""
    times = np.linspace(0.0, to, 4001)
    signals = {}
    for name, size in excite.items():
        turns = np.array([1.0, 2.3, 5.1, 11.7, 24.3]) * 2 * np.pi / to
        phases = rng.uniform(0, 2 * np.pi, len(turns))
        signals[name] = (times, size / len(turns) * np.sin(np.outer(times, turns) + phases).sum(axis=1))
    return signals
