"""Runs every reference program again and compares what it writes with the reference.json beside it, byte for byte.

`python models/check_references.py [name ...]`; needs mpmath. Exit status 1 if any differs.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

here = Path(__file__).parent
programs = [here / name / "reference.py" for name in sys.argv[1:]] or sorted(here.glob("*/reference.py"))
wrong = 0
for program in programs:
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder) / "reference.json"
        run = subprocess.run([sys.executable, program, fresh])
        same = run.returncode == 0 and fresh.read_bytes() == program.with_name("reference.json").read_bytes()
    print("same     " if same else "DIFFERENT", program.parent.name, flush=True)
    wrong += not same
sys.exit(wrong > 0)
