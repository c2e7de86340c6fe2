"""Sweeps: on this computer, through executors, stopped."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import halfarrow as ha
from conftest import MODELS
from halfarrow import sweeps

ROAD = ([0.0, 0.2, 0.2, 0.4], [0.0, 0.0, 0.3, 0.0])
REDUCE = {"peak": ("body.f", "max"), "low": ("travel", "min"), "end": ("spring.q", "final")}


def ask(car: ha.Model, **more: Any) -> sweeps.SweepResult:
    return car.sweep(
        to=1, step=1e-3, ks=np.linspace(10e3, 30e3, 25), b=[600, 900, 1200], ms=300, road=ROAD, reduce=REDUCE, **more
    )


def content(s: sweeps.SweepResult) -> list[tuple[str, str, bytes]]:
    return [(name, s.units[name], s[name].tobytes()) for name in s] + [("sets", "", s.sets.tobytes())]


def test_rows_are_runs(car: ha.Model) -> None:
    s = ask(car)
    assert list(s) == ["ks", "b", "peak", "low", "end"] and len(s.sets) == 75 and s.complete
    assert s.units["peak"] == "m/s" and s.audit["sets"] == 16 and not s.failed.any()
    for i in (0, 1, 40, 74):
        r = car.simulate(to=1, method="rk4", step=1e-3, ks=s["ks"][i], b=s["b"][i], ms=300, road=ROAD)
        assert (s["peak"][i], s["low"][i], s["end"][i]) == (r["body.f"].max(), r["travel"].min(), r["spring.q"][-1])


def test_frames_and_grids(car: ha.Model) -> None:
    s = ask(car)
    frame = s.to_pandas()
    assert list(frame.columns) == [*s, "failed"] and frame.index[0] == 1
    grid = s.to_xarray()
    assert grid["peak"].dims == ("ks", "b") and grid["peak"].shape == (25, 3)
    assert grid["peak"].sel(b=900).values.tobytes() == s["peak"][s["b"] == 900].tobytes()
    assert grid["ks"].attrs["units"] == "N/m"
    assert "75 sets" in repr(s) and "<table>" in s._repr_html_()
    assert pickle.loads(pickle.dumps(s))["peak"].tobytes() == s["peak"].tobytes()
    with pytest.raises(ha.UnknownNameError, match="did you mean `peak`"):
        s["peek"]


def test_samples(car: ha.Model) -> None:
    table = pandas.DataFrame({"ks": [10e3, 20e3], "b": [600.0, 900.0]})
    s = car.sweep(samples=table, to=1, step=1e-3, ms=[250, 300], reduce=["max(body.f)"])
    np.testing.assert_array_equal(s["ks"], [10e3, 10e3, 20e3, 20e3])
    np.testing.assert_array_equal(s["ms"], [250, 300, 250, 300])
    assert content(car.sweep(samples=dict(table), to=1, step=1e-3, ms=[250, 300], reduce=["max(body.f)"])) == content(s)
    assert s.to_xarray()["max(body.f)"].dims == ("set",)


def test_units_and_variable_steps(cart: ha.Model) -> None:
    s = cart.sweep(to=1, m=["1 kg", "2000 g"], push=3)
    np.testing.assert_array_equal(s["m"], [1.0, 2.0])
    np.testing.assert_allclose(s["final(cart.f)"], [3 * (1 - np.exp(-1)), 3 * (1 - np.exp(-0.5))], rtol=1e-5)


def test_what_cannot_be(car: ha.Model) -> None:
    for words, options in [
        ("nothing varies", {"ks": 1}),
        ("did you mean `max`", {"ks": [1, 2], "reduce": {"a": ("body.f", "maxx")}}),
        ("give a variable and what is kept", {"ks": [1, 2], "reduce": {"a": "body.f"}}),
        ("did you mean `body.f`", {"ks": [1, 2], "reduce": {"a": ("bdy.f", "max")}}),
        ("different lengths", {"samples": {"ks": [1, 2], "b": [1]}}),
        ("no parameter `kx`", {"samples": {"kx": [1, 2]}}),
        ("varied twice", {"samples": {"ks": [1, 2]}, "ks": [1]}),
        ("`ks` is given no values", {"ks": []}),
        ("chunk is 0", {"ks": [1, 2], "executor": ThreadPoolExecutor(1), "chunk": 0}),
    ]:
        with pytest.raises(ha.UsageError, match=words):
            car.sweep(to=1, step=1e-3, **options)


def test_failures_are_told_by_set() -> None:
    growing = ha.model("model M\nparam a = 1\nstate x' = a*x^2 from 1\nSe:s(x) -> R:r(1)\n")
    with pytest.warns(ha.ModelWarning, match="set 3 failed"):
        s = growing.sweep(to=1, a=[0.1, 0.5, 2.0])
    assert s.failed.tolist() == [False, False, True] and "t = 0." in s.failures[3]
    assert np.isnan(s["final(x)"][2]) and np.isfinite(s["final(x)"][:2]).all()
    with pytest.raises(ha.RunError, match="all sets failed; set 1") as caught:
        growing.sweep(to=1, a=[2.0, 3.0])
    assert caught.value.result.failed.all()


def test_numbers_that_shape_the_model(car: ha.Model) -> None:
    text = "model M\nparam n = 2\nfor i in 1..n {\n1:v[i] -> I:m[i](1 kg, f0 = 1 m/s)\nif i > 1 { v[i - 1] -> 0:j[i] -> v[i]\nj[i] -> R:r[i](1 N.s/m) }\n}\n"
    model = ha.model(text)
    here = model.sweep(to=1, step=1e-2, n=[2, 3, 4], reduce={"end": ("m[1].f", "final")})
    with ThreadPoolExecutor(2) as pool:
        there = model.sweep(to=1, step=1e-2, n=[2, 3, 4], reduce={"end": ("m[1].f", "final")}, executor=pool, chunk=1)
    assert content(here) == content(there)


def test_audits_are_warnings() -> None:
    spring = ha.model("model M\nparam k = 1 N/m\n1:v -> I:m(1 kg, f0 = 1 m/s)\nv -> C:s(k = k)\n")
    with pytest.warns(ha.AuditWarning) as caught:
        s = spring.sweep(to=5, step=0.05, k=[1e-3, 100])
    assert any("set 2:" in str(w.message) for w in caught) and all(w.filename == __file__ for w in caught)
    with pytest.warns(ha.AuditWarning), ThreadPoolExecutor(2) as pool:
        parts = spring.sweep(to=5, step=0.05, k=[1e-3, 100], executor=pool, chunk=1)
    assert s.audit["misses"] == parts.audit["misses"]
    assert s.audit["doubtful"] == parts.audit["doubtful"] and s.audit["refused"] == parts.audit["refused"]


@contextmanager
def loky() -> Iterator[Executor]:
    from joblib.externals.loky import get_reusable_executor

    executor = get_reusable_executor(max_workers=2)
    yield executor
    executor.shutdown(wait=True)


@contextmanager
def dask() -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client.get_executor()


EXECUTORS: dict[str, Callable[[], Any]] = {
    "threads": lambda: ThreadPoolExecutor(2),
    "processes": lambda: ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")),
    "forks": lambda: ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")),
    "forkserver": lambda: ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("forkserver")),
    "loky": loky,
    "dask": dask,
}


@pytest.mark.parametrize("kind", EXECUTORS)
def test_executors_give_the_same_bytes(car: ha.Model, kind: str) -> None:
    here = ask(car)
    with EXECUTORS[kind]() as executor:
        for chunk in (None, 7):
            there = ask(car, executor=executor, chunk=chunk)
            assert content(there) == content(here)
            assert there.audit == here.audit


def _in_a_fork(car: ha.Model, sink: Any) -> None:
    sink.put((content(ask(car)), car.simulate(to=1, execution="machine")["body.f"].tobytes()))


def test_forks_run_too(car: ha.Model) -> None:
    """Threads for all cores, which the parent has made, are not there any more."""
    here = content(ask(car)), car.simulate(to=1, execution="machine")["body.f"].tobytes()
    context = multiprocessing.get_context("fork")
    sink = context.Queue()
    process = context.Process(target=_in_a_fork, args=(car, sink))
    process.start()
    assert sink.get(timeout=60) == here
    process.join()


def test_threads_share_a_model(car: ha.Model) -> None:
    model = pickle.loads(pickle.dumps(car))
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda ks: model.simulate(to=1, ks=ks)["body.f"].tobytes(), [1e4, 2e4] * 8))
    assert runs == [car.simulate(to=1, ks=ks)["body.f"].tobytes() for ks in [1e4, 2e4] * 8]


class Counting(Executor):
    """Passes on to processes, and weighs what is sent."""

    _max_workers = 2

    def __init__(self, inner: Executor) -> None:
        self.inner = inner
        self.sizes: list[int] = []
        self.with_text = 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        data = pickle.dumps((fn, args, kwargs))
        self.sizes.append(len(data))
        self.with_text += b"Quarter car with a cubic damper" in data
        return self.inner.submit(fn, *args, **kwargs)


def test_the_text_is_sent_once_to_a_worker(car: ha.Model) -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        executor = Counting(pool)
        ask(car, executor=executor, chunk=5)
        # A worker that is slow to begin may take a part without the text, which is then sent again with it.
        assert 2 <= executor.with_text <= 4 and len(executor.sizes) >= 15
        assert sorted(executor.sizes)[len(executor.sizes) // 2] < 1000
        compiled = [pool.submit(_compilations).result() for _ in range(8)]
        assert max(compiled) == 1


def _compilations() -> int:
    """Models that this worker has made."""
    return len(sweeps._models)


def test_files_of_inputs_are_sent_along(car: ha.Model, tmp_path: Path) -> None:
    path = MODELS / "quarter_car" / "input.csv"
    here = car.sweep(to=1, step=1e-3, ks=[1e4, 2e4], road=path)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert content(car.sweep(to=1, step=1e-3, ks=[1e4, 2e4], road=path, executor=pool)) == content(here)
        with pytest.raises(ha.FileError, match="nothing.csv cannot be read"):
            car.sweep(to=1, step=1e-3, ks=[1e4, 2e4], road="nothing.csv", executor=pool)


def test_errors_of_workers_arrive(car: ha.Model) -> None:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        with pytest.raises(ha.UnknownNameError, match="did you mean `body.f`"):
            car.sweep(to=1, step=1e-3, ks=[1e4, 2e4], reduce=["max(bdy.f)"], executor=pool)


def test_progress(car: ha.Model) -> None:
    class Bar:
        reached = 0.0

        def update(self, n: float) -> None:
            self.reached += n

    here, there = Bar(), Bar()
    ask(car, progress=here)
    with ThreadPoolExecutor(2) as pool:
        ask(car, progress=there, executor=pool)
    assert here.reached == there.reached == 75


@pytest.mark.parametrize("threads", [False, True])
def test_control_c_keeps_the_sets_that_are_done(long: ha.Model, threads: bool) -> None:
    reached = threading.Event()

    class Bar:
        def update(self, n: float) -> None:
            reached.set()

    def interrupt() -> None:
        reached.wait(60)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    executor = ThreadPoolExecutor(2) if threads else None
    w = np.linspace(1, 2, 50_000)
    with pytest.raises(ha.Interrupted, match="of 50000 sets are done") as caught:
        long.sweep(to=10, step=1e-2, w=w, executor=executor, chunk=128, progress=Bar())
    s = caught.value.result
    assert not s.complete and 0 < len(s.sets) < 50_000
    np.testing.assert_array_equal(s["w"], w[s.sets - 1])
    if executor:
        executor.shutdown()
