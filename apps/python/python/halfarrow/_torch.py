"""A model as a function of PyTorch."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ._errors import UsageError

if TYPE_CHECKING:
    from .functions import Function


def function(of: Function) -> Callable[[Any], Any]:
    """See ``Function.torch``."""
    from .functions import missing

    try:
        import torch
    except ImportError:
        raise missing("torch") from None
    base: Any = torch.autograd.Function

    def here(tensor: Any) -> Any:
        return tensor.detach().cpu().double().numpy()

    def back(array: Any, like: Any) -> Any:
        return torch.from_numpy(np.ascontiguousarray(array)).to(device=like.device, dtype=like.dtype)

    def second(*_: Any) -> Any:
        raise UsageError("a function of a model has no second derivatives")

    def first_axis(tensor: Any, axis: int | None, size: int) -> Any:
        """The axis of `vmap` in front of all others."""
        if axis is None:
            return tensor.expand(size, *tensor.shape)
        return tensor.movedim(axis, 0)

    class Pull(base):  # type: ignore[misc]
        """Derivatives by the adjoint."""

        @staticmethod
        def forward(x: Any, w: Any) -> Any:
            return back(of.vjp(here(x), here(w)), x)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            pass

        backward = jvp = staticmethod(second)

        @staticmethod
        def vmap(info: Any, axes: Any, x: Any, w: Any) -> Any:
            x, w = (first_axis(a, axis, info.batch_size) for a, axis in zip((x, w), axes))
            return Pull.apply(x, w), 0

    class Push(base):  # type: ignore[misc]
        """The derivative along a direction."""

        @staticmethod
        def forward(x: Any, v: Any) -> Any:
            return back(of.jvp(here(x), here(v)), x)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            pass

        backward = jvp = staticmethod(second)

        @staticmethod
        def vmap(info: Any, axes: Any, x: Any, v: Any) -> Any:
            x, v = (first_axis(a, axis, info.batch_size) for a, axis in zip((x, v), axes))
            return Push.apply(x, v), 0

    class Run(base):  # type: ignore[misc]
        """The value."""

        @staticmethod
        def forward(x: Any) -> Any:
            return back(of(here(x)), x)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            ctx.save_for_backward(inputs[0])
            ctx.save_for_forward(inputs[0])

        @staticmethod
        def backward(ctx: Any, w: Any) -> Any:
            return Pull.apply(ctx.saved_tensors[0], w)

        @staticmethod
        def jvp(ctx: Any, v: Any) -> Any:
            return Push.apply(ctx.saved_tensors[0], v)

        @staticmethod
        def vmap(info: Any, axes: Any, x: Any) -> Any:
            return Run.apply(first_axis(x, axes[0], info.batch_size)), 0

    def wrapped(values: Any) -> Any:
        x = torch.as_tensor(values)
        of._given(np.empty(x.shape, np.complex64 if x.is_complex() else np.float64))
        if not torch.is_floating_point(x):
            x = x.to(torch.get_default_dtype())
        return Run.apply(x)

    return wrapped
