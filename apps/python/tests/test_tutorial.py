"""The tutorial runs from top to bottom."""

from __future__ import annotations

from pathlib import Path

import jupytext
from nbclient import NotebookClient


def test_tutorial(tmp_path: Path) -> None:
    notebook = jupytext.read(Path(__file__).parents[1] / "tutorial.py")
    NotebookClient(
        notebook, kernel_name="python3", timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    kinds = {kind for output in outputs for kind in output.get("data", {})}
    assert {"text/html", "text/latex", "image/png"} <= kinds
    assert "did you mean `mass`" in "".join(output.get("text", "") for output in outputs)
