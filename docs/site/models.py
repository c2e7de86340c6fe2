"""The gallery: a page for each model, with what the program says about it and draws of it."""

from __future__ import annotations

import html
import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import mathml
from program import MADE, ROOT, halfarrow, program

MODELS = ROOT / "models"
#: Equations of more characters are left as text.
LONG = 1500


@dataclass
class Shown:
    """A page of the gallery, and its pictures."""

    name: str
    title: str
    text: str
    pictures: list[Path]


def gallery() -> list[Shown]:
    names = sorted(path.parent.name for path in MODELS.glob("*/model.bond"))
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(shown, names))


def shown(name: str) -> Shown:
    source = MODELS / name / "model.bond"
    model = source.read_text()
    head = re.match(r'model (\w+) "([^"]*)"', model)
    assert head, name
    about = head[2][0].upper() + head[2][1:]
    folder = MADE / "models" / name
    reference = json.loads((MODELS / name / "reference.json").read_text())
    end = float(reference["t"][-1])
    inputs = [f for n, file in reference.get("inputs", {}).items() for f in ("--input", f"{n}=models/{name}/{file}")]
    relative = source.relative_to(ROOT)
    run = ["simulate", relative, "--to", f"{end:g}", "--every", f"{end / 500:g}", *inputs]
    draw(folder, source, relative, run)
    command = " ".join(map(str, ["halfarrow", *run]))
    parts = [
        f"# {head[1]}\n\n{about}.\n",
        f"![Bond graph]({name}/graph.svg)\n",
        f"{readme(name)}\n",
        f'```bond title="models/{name}/model.bond"\n{model}```\n',
        f"## Equations\n\n{equations(relative)}\n",
        f"## Zero-order causal paths and storages\n\n```text\n{halfarrow('loops', relative)}```\n",
        f"## Motion\n\n![Motion]({name}/motion.svg)\n\n    {command} --plot motion.svg\n",
    ]
    text = "\n".join(part for part in parts if part.strip())
    return Shown(name, about, text, [folder / "graph.svg", folder / "motion.svg"])


def draw(folder: Path, source: Path, relative: Path, run: list[str | Path]) -> None:
    """Pictures are drawn anew where model or program have changed."""
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / "stamp"
    stamp = f"{source.read_text()}{run}{program().stat().st_mtime_ns}"
    if mark.exists() and mark.read_text() == stamp:
        return
    halfarrow("draw", relative, "--out", folder / "graph.svg")
    halfarrow(*run, "--plot", folder / "motion.svg")
    mark.write_text(stamp)


def readme(name: str) -> str:
    path = MODELS / name / "README.md"
    return path.read_text().split("\n", 1)[1].strip() + "\n" if path.exists() else ""


def equations(relative: Path) -> str:
    latex = halfarrow("equations", relative, "--format", "latex")
    if len(latex) <= LONG:
        return mathml.aligned(latex)
    return f"```text\n{halfarrow('equations', relative)}```"


def index(shown: list[Shown]) -> str:
    cards = "".join(
        f'<a class="card" href="{s.name}.html"><img src="{s.name}/graph.svg" alt="" loading="lazy">'
        f"<strong>{html.escape(s.name)}</strong><span>{html.escape(s.title)}</span></a>\n"
        for s in shown
    )
    return (
        "# Models\n\n"
        f"{len(shown)} models with independent references, by the folders in `models/`. Each page is made by the program "
        "when this site is built: drawing, equations, causal paths, motion. Every model is compared in the tests with values "
        "from a closed form or an independent program, in `reference.json`.\n\n"
        f'<div class="cards">\n{cards}</div>\n'
    )
