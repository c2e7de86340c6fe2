"""Executors for sweeps, where a library has none of its own.

Most have: ``concurrent.futures``, joblib's loky (``get_reusable_executor()``), Dask (``client.get_executor()``), MPI
(``mpi4py.futures.MPIPoolExecutor``).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

from ._errors import UsageError, needed

Value = TypeVar("Value")


class RayExecutor(Executor):
    """Tasks on the Ray cluster that the program is connected to: ``ray.init()`` comes first.

    Args:
        options: What each task asks of the cluster, as in ``ray.remote``: ``num_cpus=1``.

    Raises:
        UsageError: Ray is not there, or not connected.
    """

    def __init__(self, **options: Any) -> None:
        try:
            ray: Any = importlib.import_module("ray")
        except ImportError:
            raise needed("ray", "ray", "RayExecutor") from None
        if not ray.is_initialized():
            raise UsageError("Ray is not connected to a cluster: call `ray.init()` first")
        remote: Any = ray.remote(_call)
        self._task = remote.options(**options) if options else remote
        self._max_workers = int(ray.cluster_resources().get("CPU", 1))

    def submit(self, fn: Callable[..., Value], /, *args: Any, **kwargs: Any) -> Future[Value]:
        """Runs a function on the cluster."""
        future: Future[Value] = self._task.remote(fn, args, kwargs).future()
        return future


def _call(fn: Callable[..., Value], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Value:
    return fn(*args, **kwargs)
