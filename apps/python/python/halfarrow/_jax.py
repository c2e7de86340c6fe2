"""A model as a function of JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .functions import Function


def function(of: Function, mode: str) -> Callable[[Any], Any]:
    """See ``Function.jax``."""
    from .functions import missing

    try:
        import jax
        import jax.numpy as jnp
    except ImportError:
        raise missing("jax") from None
    shaped: Any = jax.ShapeDtypeStruct
    samples, outputs, parameters = len(of.t), len(of.outputs), len(of.parameters)

    def called(work: Callable[..., Any], shape: tuple[int, ...], x: Any, *more: Any) -> Any:
        def here(*arrays: Any) -> Any:
            return work(*(np.asarray(array) for array in arrays)).astype(x.dtype)

        return jax.pure_callback(here, shaped(shape, x.dtype), x, *more, vmap_method="expand_dims")

    def value(x: Any) -> Any:
        return called(of, (samples, outputs), x)

    run: Any
    if mode == "reverse":
        run = jax.custom_vjp(value)
        run.defvjp(lambda x: (value(x), x), lambda x, w: (called(of.vjp, (parameters,), x, w),))
    else:
        run = jax.custom_jvp(value)

        def along(primals: Any, tangents: Any) -> Any:
            (x,), (v,) = primals, tangents
            slopes = called(of.jacobian, (samples, outputs, parameters), x)
            return run(x), slopes @ v

        run.defjvp(along)

    def wrapped(values: Any) -> Any:
        x = jnp.asarray(values)
        of._given(np.empty(x.shape, np.complex64 if jnp.iscomplexobj(x) else np.float64))
        if not jnp.issubdtype(x.dtype, jnp.floating):
            x = x.astype(jnp.result_type(float))
        return run(x) if x.ndim == 1 else jax.vmap(wrapped)(x)

    return wrapped
