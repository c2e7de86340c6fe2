"""Sweeps that are kept: journals that survive a kill, folders of Parquet, workers that die."""

from __future__ import annotations

import json
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_sweeps import ROAD, ask, content

import halfarrow as ha
from conftest import LONG, MODELS
from halfarrow import sweeps

SPAWN = multiprocessing.get_context("spawn")


def test_a_journal_gives_what_it_has(car: ha.Model, tmp_path: Path) -> None:
    here, path = ask(car), tmp_path / "new" / "a.journal"
    first = ask(car, journal=path, chunk=20)
    assert content(first) == content(here) and first.audit == here.audit and first.resumed == 0
    again = ask(car, journal=path)
    assert content(again) == content(here) and again.audit == here.audit and again.resumed == 75
    anew = ask(car, journal=path, restart=True)
    assert content(anew) == content(here) and anew.resumed == 0


def test_a_journal_cut_anywhere_goes_on(car: ha.Model, tmp_path: Path) -> None:
    here, path = ask(car), tmp_path / "a.journal"
    ask(car, journal=path, chunk=20)
    whole = path.read_bytes()
    seen = set()
    for length in [*range(0, 2000, 97), *range(2000, len(whole), 523), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with ThreadPoolExecutor(2) as pool:
            there = ask(car, journal=path, executor=pool, chunk=11)
        assert content(there) == content(here) and there.audit == here.audit
        seen.add(there.resumed)
    assert seen == {0, 20, 40, 60}
    torn = bytearray(whole)
    torn[-5] ^= 1
    path.write_bytes(torn)
    assert ask(car, journal=path).resumed == 60


def test_another_sweep_is_refused_with_the_reason(car: ha.Model, tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    ask(car, journal=path)
    other = car.with_parameters(kt=200e3)
    for words, call in [
        ("its model is another one", lambda: ask(other, journal=path)),
        ("keeps .*peak|other names|it keeps", lambda: sweep_of(car, path, reduce=["max(body.f)"])),
        ("its `to` is 1.0, not 2.0|its `to` is 1, not 2", lambda: sweep_of(car, path, to=2)),
        ("it has 75 sets, not 3", lambda: sweep_of(car, path, ks=[1e4])),
        ("its parameters have other values", lambda: sweep_of(car, path, ms=301)),
        ("its inputs are others", lambda: sweep_of(car, path, road=0)),
    ]:
        with pytest.raises(ha.UsageError, match=words):
            call()
    assert ask(car, journal=path).resumed == 75
    (tmp_path / "text").write_text("something else\nin lines\n")
    with pytest.raises(ha.UsageError, match="is no journal"):
        ask(car, journal=tmp_path / "text")
    with pytest.raises(ha.UsageError, match="not both"):
        ask(car, journal=path, into=tmp_path)


def sweep_of(car: ha.Model, path: Path, **more: Any) -> ha.SweepResult:
    reduce = {"peak": ("body.f", "max"), "low": ("travel", "min"), "end": ("spring.q", "final")}
    asked: dict[str, Any] = {
        "to": 1, "step": 1e-3, "ks": np.linspace(10e3, 30e3, 25), "b": [600, 900, 1200], "ms": 300, "road": ROAD,
        "reduce": reduce,
    }  # fmt: skip
    return car.sweep(**{**asked, **more}, journal=path)


def test_two_at_once_are_refused(car: ha.Model, tmp_path: Path) -> None:
    begun, ready = threading.Event(), threading.Event()

    class Bar:
        def update(self, n: float) -> None:
            begun.set()
            ready.wait(30)

    with ThreadPoolExecutor(1) as pool:
        one = pool.submit(ask, car, journal=tmp_path / "a", chunk=20, progress=Bar())
        begun.wait(30)
        with pytest.raises(ha.UsageError, match="just now"):
            ask(car, journal=tmp_path / "a")
        ready.set()
        assert content(one.result()) == content(ask(car))


KILLED = """
import sys
import numpy as np
import halfarrow as ha

ha.model(open(sys.argv[1]).read()).sweep(
    to=5, step=2e-3, w=np.linspace(1, 2, 20_000), **{sys.argv[2]: sys.argv[3]}, chunk=64
)
"""


@pytest.mark.parametrize("way", ["journal", "into"])
def test_a_program_that_is_killed_is_gone_on_with(long: ha.Model, tmp_path: Path, way: str) -> None:
    if way == "into":
        pytest.importorskip("pyarrow")
    (tmp_path / "long.bond").write_text(LONG)
    kept = tmp_path / "kept"
    command = [sys.executable, "-c", KILLED, tmp_path / "long.bond", way, kept]
    process = subprocess.Popen(command)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and not (
        len(list(kept.glob("part-*"))) > 3 if way == "into" else kept.is_file() and kept.stat().st_size > 10_000
    ):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    # The text is the same, the name of the file another.
    model = ha.model(LONG)
    options: dict[str, Any] = {"to": 5, "step": 2e-3, "w": np.linspace(1, 2, 20_000)}
    there = model.sweep(**options, **{way: kept})
    assert 0 < there.resumed < 20_000
    here = model.sweep(**options)
    assert content(there) == content(here)


class Killing(Executor):
    """Passes on to processes, one of which is killed in the middle."""

    _max_workers = 2

    def __init__(self, times: list[int]) -> None:
        self.inner = ProcessPoolExecutor(2, mp_context=SPAWN)
        self.times, self.seen = times, 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future = self.inner.submit(fn, *args, **kwargs)
        future.add_done_callback(self.done)
        return future

    def done(self, _: Future[Any]) -> None:
        self.seen += 1
        if self.times and self.seen == self.times[0]:
            self.times.pop(0)
            os.kill(next(iter(self.inner._processes)), signal.SIGKILL)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self.inner.shutdown(wait, cancel_futures=cancel_futures)


def test_a_worker_that_is_killed_loses_nothing(car: ha.Model, tmp_path: Path) -> None:
    here = ask(car)
    with (
        Killing([6]) as executor,
        pytest.raises(ha.RunError, match="a worker was killed.*ProcessPoolExecutor") as caught,
    ):
        ask(car, executor=executor, chunk=3, journal=tmp_path / "a")
    part = caught.value.result
    assert not part.complete and 0 < part.done < 75
    np.testing.assert_array_equal(part["peak"], here["peak"][part.sets - 1])
    assert "goes on from" in str(caught.value)
    there = ask(car, journal=tmp_path / "a")
    assert there.resumed == part.done and content(there) == content(here) and there.audit == here.audit
    # What makes executors makes others.
    times = [4, 4, 4]
    there = ask(car, executor=lambda: Killing(times), chunk=3)
    assert not times and content(there) == content(here) and there.audit == here.audit


def _die(*_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


class Deadly(Killing):
    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self.inner.submit(_die)


def test_what_always_kills_its_worker_is_given_up(car: ha.Model) -> None:
    made = []

    def make() -> Executor:
        made.append(Deadly([]))
        return made[-1]

    with pytest.raises(ha.RunError, match="0 of 75 sets are done") as caught:
        ask(car, executor=make)
    assert len(made) == 3 and caught.value.result is None


class Losing(Executor):
    """Loses what some parts came to, and tells so with an exception of its own, as Dask does."""

    _max_workers = 2

    def __init__(self, losses: int) -> None:
        self.inner = ThreadPoolExecutor(2)
        self.losses, self.begun = losses, 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future = self.inner.submit(fn, *args, **kwargs)
        self.begun += 1
        if self.begun > 6 and self.losses:
            self.losses -= 1
            lost: Future[Any] = Future()
            lost.set_exception(TypeError("cannot unpack"))
            return lost
        return future


def test_a_part_that_an_executor_loses_is_begun_again(car: ha.Model) -> None:
    there, here = ask(car, executor=(executor := Losing(4)), chunk=3), ask(car)
    assert not executor.losses and content(there) == content(here) and there.audit == here.audit
    with pytest.raises(ha.RunError, match=r"a worker has failed: TypeError\('cannot unpack'\); \d+ of 75 sets are done"):
        ask(car, executor=(executor := Losing(1000)), chunk=3)
    assert executor.losses > 950


def test_dask_and_loky_lose_nothing(car: ha.Model) -> None:
    from distributed import Client, LocalCluster
    from joblib.externals.loky import get_reusable_executor

    here = ask(car)
    killed = []

    class Bar:
        reached = 0.0

        def update(self, n: float) -> None:
            self.reached += n
            if self.reached > 15 and not killed:
                killed.append(victim())
                os.kill(killed[0], signal.SIGKILL)

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        victim: Callable[[], int] = lambda: next(iter(client.run(os.getpid).values()))
        there = ask(car, executor=client.get_executor(), chunk=3, progress=Bar())
    assert killed and content(there) == content(here) and there.audit == here.audit
    killed.clear()
    victim = lambda: next(iter(get_reusable_executor(max_workers=2)._processes))
    there = ask(car, executor=lambda: get_reusable_executor(max_workers=2), chunk=3, progress=Bar())
    assert killed and content(there) == content(here) and there.audit == here.audit


def test_files_hold_the_same_bytes(car: ha.Model, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    here = ask(car)
    ways: dict[str, dict[str, Any]] = {"here": {}, "chunks": {"chunk": 10}}
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2, mp_context=SPAWN) as processes:
        ways["threads"] = {"executor": threads, "chunk": 10}
        ways["processes"] = {"executor": processes, "chunk": 7}
        for name, way in ways.items():
            s = ask(car, into=tmp_path / name, **way)
            assert isinstance(s, ha.SweepFiles) and content(s) == content(here) and s.audit == here.audit
            assert s.complete and s.done == 75 and not s.failed.any()
            assert len(s.files) == -(-75 // way.get("chunk", 75))
    assert "75 sets" in repr(s) and "<table>" in s._repr_html_() and s.to_xarray()["peak"].shape == (25, 3)
    assert np.concatenate([part["peak"] for part in s.parts()]).tobytes() == here["peak"].tobytes()
    for found in (
        ha.read_sweep(tmp_path / "chunks"),
        pickle.loads(pickle.dumps(s)),
        ask(car, into=tmp_path / "chunks"),
    ):
        assert content(found) == content(here) and found.audit == here.audit
        assert found.to_xarray()["peak"].shape == (25, 3)
    assert found.resumed == 75
    with pytest.raises(ha.UsageError, match="did you mean `peak`"):
        s["peek"]
    with pytest.raises(ha.UsageError, match="holds another sweep: its parameters have other values"):
        car.sweep(to=1, step=1e-3, ks=np.linspace(10e3, 30e3, 75), ms=300, road=ROAD, into=tmp_path / "chunks",
                  reduce={"peak": ("body.f", "max"), "low": ("travel", "min"), "end": ("spring.q", "final")})  # fmt: skip
    with pytest.raises(ha.FileError, match="holds no sweep"):
        ha.read_sweep(tmp_path)


def test_files_that_are_missing_are_made_again(car: ha.Model, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    here = ask(car, into=tmp_path / "a", chunk=10)
    here.files[3].unlink()
    about = tmp_path / "a" / "_sweep.json"
    told = json.loads(about.read_text())
    # As it stands while a sweep runs.
    about.write_text(json.dumps({**{k: told[k] for k in ("identity", "model", "grid")}, "complete": False}))
    (tmp_path / "a" / ".part-x.partial").write_text("half of a file")
    stopped = ha.read_sweep(tmp_path / "a")
    assert not stopped.complete and stopped.done == 65 and len(stopped["peak"]) == 65
    there = ask(car, into=tmp_path / "a", chunk=3)
    assert there.resumed == 65 and content(there) == content(ask(car)) and there.audit == ask(car).audit
    assert not list((tmp_path / "a").glob(".*"))
    about.unlink()
    with pytest.raises(ha.UsageError, match="something else"):
        ask(car, into=tmp_path / "a")
    assert ask(car, into=tmp_path / "a", restart=True).resumed == 0


def test_whole_trajectories(car: ha.Model, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    sets: dict[str, Any] = {"ks": [10e3, 20e3, 30e3], "b": [600, 900], "road": ROAD, "ms": 300}
    there = car.sweep(to=1, every=0.01, into=tmp_path / "a", whole=True, chunk=2, record=["travel", "body.f"], **sets)
    assert (
        list(there) == ["ks", "b", "t", "travel", "body.f"] and there.done == 6 and len(there["t"]) == len(there.sets)
    )
    assert there.units["travel"] == "m" and there.units["ks"] == "N/m" and there.audit["sets"] == 6
    for number, (ks, b) in enumerate([(ks, b) for ks in sets["ks"] for b in sets["b"]], 1):
        r = car.simulate(to=1, every=0.01, record=["travel", "body.f"], ms=300, road=ROAD, ks=ks, b=b)
        own = there.sets == number
        assert r.t.tobytes() == there["t"][own].tobytes() and r["travel"].tobytes() == there["travel"][own].tobytes()
        assert set(there["ks"][own]) == {ks} and set(there["b"][own]) == {b}
    with ProcessPoolExecutor(2, mp_context=SPAWN) as pool:
        other = car.sweep(
            to=1, every=0.01, into=tmp_path / "b", whole=True, executor=pool, record=["travel", "body.f"], **sets
        )
    assert content(other) == content(there) and other.audit == there.audit
    with pytest.raises(ha.UsageError, match="whole trajectories go `into` a folder"):
        car.sweep(to=1, whole=True, ks=[1e4])


def test_control_c_leaves_whole_trajectories(long: ha.Model, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    options: dict[str, Any] = {"to": 10, "step": 1e-3, "every": 0.1, "w": np.linspace(1, 2, 20_000), "whole": True}

    def interrupt() -> None:
        while len(list(tmp_path.glob("a/part-*"))) < 2:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(ha.Interrupted, match="of 20000 sets are done.*goes on from") as caught:
        long.sweep(**options, chunk=400, into=tmp_path / "a")
    begun = time.monotonic()
    s = caught.value.result
    assert 400 <= s.done < 20_000 and not s.complete and set(s.sets) >= {1, 400}
    assert time.monotonic() - begun < 5


def test_runs_that_fail_are_in_the_files(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    growing = ha.model("model M\nparam a = 1\nstate x' = a*x^2 from 1\nSe:s(x) -> R:r(1)\n")
    with pytest.warns(ha.ModelWarning, match="set 3 failed"):
        s = growing.sweep(to=1, a=[0.1, 0.5, 2.0], into=tmp_path / "a")
    assert s.failed.tolist() == [False, False, True] and "t = 0." in s.failures[3] and np.isnan(s["final(x)"][2])
    with pytest.warns(ha.ModelWarning, match="set 3 failed"):
        s = growing.sweep(to=1, a=[0.1, 0.5, 2.0], every=0.1, into=tmp_path / "b", whole=True)
    assert set(s.sets[s.failed]) == {3} and s["t"][s.failed].max() < 0.51


def test_others_read_the_files(car: ha.Model, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    s = ask(car, into=tmp_path / "a", chunk=10)
    assert isinstance(s, ha.SweepFiles)
    polars = pytest.importorskip("polars")
    frame = polars.scan_parquet(s.pattern).filter(polars.col("b") == 900).sort("set").collect()
    assert frame["peak"].to_numpy().tobytes() == s["peak"][s["b"] == 900].tobytes() and len(frame) == 25
    duckdb = pytest.importorskip("duckdb")
    assert duckdb.sql(f"select count(*), max(peak) from '{s.pattern}' where not failed").fetchall() == [
        (75, s["peak"].max())
    ]
    dask = pytest.importorskip("dask.dataframe")
    assert dask.read_parquet(s.pattern).peak.max().compute() == s["peak"].max()
    assert dask.read_parquet(str(tmp_path / "a")).peak.count().compute() == 75


def test_the_sets_of_a_grid(car: ha.Model) -> None:
    import itertools

    plan = sweeps.Plan(
        {}, [], {"ms": 3.0}, {"a": np.arange(3.0), "b": np.arange(4.0)}, (["x"], np.array([[7.0], [8.0]])), {}
    )
    names, rows = plan.sets()
    assert names == ["x", "ms", "a", "b"]
    np.testing.assert_array_equal(rows, [[x, 3, a, b] for x, a, b in itertools.product([7, 8], range(3), range(4))])
    assert MODELS.is_dir()
