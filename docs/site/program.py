"""Where the program is, and how the pages of the site run it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: What pages make when they are run: pictures and files.
MADE = ROOT / "target" / "site"


def program() -> Path:
    """`HALFARROW`, else what the tests have built, else what is installed."""
    known = os.environ.get("HALFARROW") or ROOT / "target/debug/halfarrow"
    found = known if Path(known).is_file() else shutil.which("halfarrow")
    if not found:
        raise SystemExit("no program: set HALFARROW, or `cargo build --bin halfarrow`")
    return Path(found).resolve()


def halfarrow(*arguments: str | Path, folder: Path = ROOT, columns: int = 100) -> str:
    """Standard output of a run that went well."""
    run = subprocess.run(
        [program(), *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "COLUMNS": str(columns)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    if run.returncode:
        raise RuntimeError(f"halfarrow {' '.join(map(str, arguments))}\n{run.stdout}{run.stderr}")
    return run.stdout
