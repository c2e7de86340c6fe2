"""Sweeps through clusters: throughput beside the command's own, the same bytes through every engine, workers that are killed.

`pip install './apps/python[parquet,dask,ray,mpi]' joblib mpich`, `python bench/clusters.py [sets] [path of halfarrow]`. The
quarter car with 1,000 steps a set. What engines need to begin is not counted: each has run a small sweep before. Ways are
timed in turns; the ratio is that of the medians.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import halfarrow as ha

ROOT = Path(__file__).resolve().parents[1]
CAR = ROOT / "models" / "quarter_car" / "model.bond"
WORKERS = 2
TURNS = 5
STIFF = 100


def ask(car: ha.Model, sets: int, **more: Any) -> ha.SweepResult:
    ks, b = np.linspace(10e3, 30e3, STIFF), np.linspace(600, 1200, sets // STIFF)
    return car.sweep(
        to=1, step=1e-3, ks=ks, b=b, reduce=["max(body.f)", "final(spring.q)"], **more
    )


def digest(s: ha.SweepResult) -> str:
    found = hashlib.sha256()
    for name in s:
        found.update(name.encode() + s[name].tobytes())
    found.update(s.sets.tobytes() + s.failed.tobytes() + repr(s.audit).encode())
    return found.hexdigest()[:16]


@contextmanager
def loky() -> Iterator[Executor]:
    from joblib.externals.loky import get_reusable_executor

    executor = get_reusable_executor(max_workers=WORKERS)
    yield executor
    executor.shutdown(wait=True)


@contextmanager
def dask() -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        Client(cluster) as c,
    ):
        yield c.get_executor()


@contextmanager
def ray() -> Iterator[Executor]:
    import ray as library

    from halfarrow.executors import RayExecutor

    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    library.init(
        num_cpus=WORKERS,
        include_dashboard=False,
        log_to_driver=False,
        configure_logging=False,
    )
    yield RayExecutor()
    library.shutdown()


ENGINES: dict[str, Callable[[], Any]] = {
    "threads": lambda: ThreadPoolExecutor(WORKERS),
    "processes": lambda: ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")),
    "loky": loky,
    "dask": dask,
    "ray": ray,
}


def by_command(command: str, sets: int, folder: Path) -> float:
    begun = time.perf_counter()
    subprocess.run(
        [command, "sweep", CAR, "--to", "1", "--step", "1ms", "--vary", f"ks=lin(10e3,30e3,{STIFF})", "--vary",
         f"b=lin(600,1200,{sets // STIFF})", "--reduce", "max(body.f),final(spring.q)", "--out", folder / "x.parquet"],
        check=True, capture_output=True,
    )  # fmt: skip
    return time.perf_counter() - begun


def throughput(
    car: ha.Model, sets: int, command: str, folder: Path, running: dict[str, Executor]
) -> None:
    times: dict[str, list[float]] = {}
    digests = set()

    def timed(name: str, call: Callable[[], ha.SweepResult]) -> None:
        begun = time.perf_counter()
        s = call()
        times.setdefault(name, []).append(time.perf_counter() - begun)
        digests.add(digest(s))

    for _ in range(TURNS):
        times.setdefault("command", []).append(by_command(command, sets, folder))
        timed("here", lambda: ask(car, sets))
        timed(
            "here, journal",
            lambda: ask(car, sets, journal=folder / "journal", restart=True),
        )
        timed(
            "here, into Parquet",
            lambda: ask(car, sets, into=folder / "parts", restart=True),
        )
        for name, executor in running.items():
            timed(name, lambda executor=executor: ask(car, sets, executor=executor))
        for name in ("processes", "dask", "ray"):
            into = {"into": folder / name, "restart": True}
            timed(
                f"{name}, into Parquet",
                lambda e=running[name], into=into: ask(car, sets, executor=e, **into),
            )
    own = statistics.median(times["command"])
    for name, taken in times.items():
        middle = statistics.median(taken)
        print(
            f"{name:24} {sets / middle:9.0f} sets/s  {own / middle:5.2f} of the command's"
        )
    print(f"results of all ways: {len(digests)} kind, {digests.pop()}")


MPI = """
import sys
import time
from mpi4py.futures import MPIPoolExecutor
import halfarrow as ha
import clusters

if __name__ == "__main__":
    car = ha.load(clusters.CAR)
    with MPIPoolExecutor() as executor:
        clusters.ask(car, 6400, executor=executor)
        begun = time.perf_counter()
        s = clusters.ask(car, int(sys.argv[1]), executor=executor)
        took = time.perf_counter() - begun
    same = clusters.digest(s) == clusters.digest(clusters.ask(car, int(sys.argv[1])))
    print(f"{len(s.sets) / took:.0f} sets/s by one worker, the same bytes: {same}")
"""


def by_mpi(sets: int, folder: Path) -> None:
    beside = Path(sys.executable).parent / "mpiexec"
    mpiexec = str(beside) if beside.is_file() else shutil.which("mpiexec")
    if mpiexec is None:
        print("mpi: no mpiexec")
        return
    (folder / "by_mpi.py").write_text(MPI)
    command = [
        mpiexec,
        "-n",
        "2",
        sys.executable,
        "-m",
        "mpi4py.futures",
        folder / "by_mpi.py",
        str(sets),
    ]
    known = os.pathsep.join(
        [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    )
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": known},
        capture_output=True,
        text=True,
        check=False,
    )
    print(f"mpiexec -n 2: {done.stdout.strip() or done.stderr}")


def killed(car: ha.Model, sets: int, folder: Path) -> None:
    """What each engine does when a worker is killed in the middle."""
    wanted = digest(ask(car, sets))

    class Bar:
        def __init__(self, victim: Callable[[], int]) -> None:
            self.victim: Callable[[], int] | None = victim
            self.reached = 0.0

        def update(self, n: float) -> None:
            self.reached += n
            if self.victim is not None and self.reached > sets / 3:
                victim, self.victim = self.victim, None
                os.kill(victim(), signal.SIGKILL)

    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        try:
            ask(
                car,
                sets,
                executor=pool,
                progress=Bar(lambda: next(iter(pool._processes))),
                journal=folder / "killed",
            )
        except ha.RunError as why:
            print(f"processes: {why}")
    s = ask(car, sets, journal=folder / "killed")
    print(
        f"processes, gone on with: {s.resumed} sets from the journal, the same bytes: {digest(s) == wanted}"
    )

    made: list[ProcessPoolExecutor] = []

    def make() -> Executor:
        made.append(ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")))
        return made[-1]

    s = ask(
        car, sets, executor=make, progress=Bar(lambda: next(iter(made[-1]._processes)))
    )
    print(
        f"processes, made when needed: {len(made)} pools, the same bytes: {digest(s) == wanted}"
    )

    from joblib.externals.loky import get_reusable_executor

    reusable: Callable[[], Any] = lambda: get_reusable_executor(max_workers=WORKERS)
    s = ask(
        car,
        sets,
        executor=reusable,
        progress=Bar(lambda: next(iter(reusable()._processes))),
    )
    print(f"loky, made when needed: the same bytes: {digest(s) == wanted}")
    with dask() as executor:
        victim: Callable[[], int] = lambda: next(
            iter(executor._client.run(os.getpid).values())
        )
        s = ask(car, sets, executor=executor, progress=Bar(victim))
        print(
            f"dask, which runs its tasks again: the same bytes: {digest(s) == wanted}"
        )
    with ray() as executor:
        s = ask(
            car,
            sets,
            executor=executor,
            progress=Bar(lambda: executor.submit(os.getpid).result()),
        )
        print(f"ray, which runs its tasks again: the same bytes: {digest(s) == wanted}")

    for way in ("journal", "into"):
        script = f"import clusters, halfarrow as ha; clusters.ask(ha.load(clusters.CAR), {sets}, {way}=r'{folder}/own {way}')"
        process = subprocess.Popen(
            [sys.executable, "-c", script], cwd=Path(__file__).parent
        )
        kept = folder / f"own {way}"
        while process.poll() is None and not (
            kept.is_file()
            and kept.stat().st_size > 10 * sets
            or len(list(kept.glob("part-*"))) > 3
        ):
            time.sleep(0.001)
        process.kill()
        process.wait()
        s = ask(car, sets, **{way: kept})
        print(
            f"the program killed, {way}: {s.resumed} sets from before, the same bytes: {digest(s) == wanted}"
        )


def main(sets: int, command: str) -> None:
    car = ha.load(CAR)
    print(f"{sets} sets, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        running = {name: stack.enter_context(make()) for name, make in ENGINES.items()}
        for executor in running.values():
            ask(car, 6400, executor=executor)
        throughput(car, sets, command, folder, running)
    with tempfile.TemporaryDirectory() as name:
        by_mpi(sets, Path(name))
        killed(car, sets, Path(name))
    print(f"load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 100_000,
        sys.argv[2]
        if len(sys.argv) > 2
        else shutil.which("halfarrow")
        or str(ROOT / "target" / "release" / "halfarrow"),
    )
