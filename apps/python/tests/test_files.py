"""What models are written as: C, FMUs, LaTeX, reports; and forms beside each other."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import pytest

import halfarrow as ha


def test_export(cart: ha.Model, tmp_path: Path) -> None:
    report = cart.export("c", tmp_path / "c", step=1e-2)
    assert report["cost"]["total"] > 0 and report["inputs"] == ["push"]
    assert sorted(Path(p).name for p in report["written"]) == ["CMakeLists.txt", "cart.c", "cart.h", "main.c"]
    cart.export("latex", tmp_path / "cart.tex")
    assert "\\documentclass" in (tmp_path / "cart.tex").read_text()
    for target in ("fmu2", "fmu3"):
        cart.export(target, tmp_path / f"{target}.fmu", binary=shutil.which("cc") is not None)  # type: ignore[arg-type]
        assert "modelDescription.xml" in zipfile.ZipFile(tmp_path / f"{target}.fmu").namelist()
    assert not list(tmp_path.glob("*.partial"))


def test_export_that_cannot_be(cart: ha.Model, tmp_path: Path) -> None:
    with pytest.raises(ha.UsageError, match="let it end in .fmu"):
        cart.export("fmu3", tmp_path / "cart.zip")
    with pytest.raises(ha.UsageError, match="did you mean `fmu3`|did you mean `fmu2`"):
        cart.export("fmu4", tmp_path / "cart.fmu")  # type: ignore[arg-type]
    with pytest.raises(ha.UsageError, match='`real="float"` is for `export c`'):
        cart.export("fmu3", tmp_path / "cart.fmu", real="float")
    (tmp_path / "file").write_text("")
    with pytest.raises(ha.FileError, match="cannot be written"):
        cart.export("latex", tmp_path / "file" / "cart.tex")


def test_compare(cart: ha.Model) -> None:
    reached: list[float] = []

    class Bar:
        def update(self, n: float) -> None:
            reached.append(n)

    compared = cart.compare(to=1, repeats=1, patience=0.5, budget=5, inputs={"push": lambda t: 3.0}, progress=Bar())
    assert [row["form"] for row in compared.rows][0] == "minimal" and compared.refused == []
    assert "minimal" in str(compared) and compared.to_pandas().loc["minimal", "differential"] == 1
    assert "<svg" in compared._repr_html_() and sum(reached) <= 1.0 + 1e-9
    with pytest.raises(ha.UsageError, match="give `to`"):
        cart.compare(inputs={"push": lambda t: 3.0})


def test_report(cart: ha.Model, tmp_path: Path) -> None:
    cart.report(tmp_path / "cart.html", to=1, compare=False, inputs={"push": 3})
    page = (tmp_path / "cart.html").read_text()
    assert "<svg" in page and "Cart" in page
    with pytest.raises(ha.UsageError, match="let it end in .html"):
        cart.report(tmp_path / "cart.pdf")
