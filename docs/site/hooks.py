"""Hooks of MkDocs: pages and pictures that the program makes, links that leave the site, formulas, colours of models."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bond_lexer  # noqa: E402, F401 (Pygments looks for it by its name)
import commands  # noqa: E402
import mathml  # noqa: E402
import models  # noqa: E402
import pygments.lexers  # noqa: E402
import snippets  # noqa: E402
from mkdocs.structure.files import File, Files  # noqa: E402
from program import ROOT  # noqa: E402

EXAMPLES = ["sedan", "iltis", "suspensions", "robot", "bicycle", "satellite", "stewart"]


def on_config(config: Any) -> Any:
    pygments.lexers.LEXERS["BondLexer"] = ("bond_lexer", "Bond", ("bond",), ("*.bond",), ())
    formats = config.mdx_configs
    formats["pymdownx.superfences"] = {
        "custom_fences": [{"name": "math", "class": "math", "format": lambda source, *_, **__: mathml.block(source)}]
    }
    formats["pymdownx.inlinehilite"] = {
        "custom_inline": [{"name": "math", "class": "math", "format": lambda source, *_, **__: mathml.inline(source)}]
    }
    return config


def on_files(files: Files, config: Any) -> Files:
    def page(path: str, content: str) -> None:
        files.append(File.generated(config, path, content=content))

    def picture(path: str, source: Path) -> None:
        files.append(File.generated(config, path, abs_src_path=str(source)))

    page("commands.md", commands.reference())
    gallery = models.gallery()
    page("models/index.md", models.index(gallery))
    for shown in gallery:
        page(f"models/{shown.name}.md", shown.text)
        for path in shown.pictures:
            picture(f"models/{shown.name}/{path.name}", path)
    for example in EXAMPLES:
        folder = ROOT / "examples" / example
        page(f"examples/{example}/{example}.md", (folder / "README.md").read_text())
        for path in sorted([*folder.glob("*.svg"), *folder.glob("*.png")]):
            picture(f"examples/{example}/{path.name}", path)
    for source in snippets.pages():
        folder = snippets.made(source)
        where = source.relative_to(snippets.DOCS).with_suffix("")
        for path in sorted(p for p in folder.rglob("*") if p.suffix in (".svg", ".png", ".html")):
            picture(f"{where}/{path.relative_to(folder)}", path)
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links to files of the repository that are no pages become their paths."""
    if page.file.src_uri == "python.md":
        markdown += not_listed(markdown)

    def target(match: re.Match[str]) -> str:
        text, link = match[1], match[2]
        if re.match(r"[a-z]+:|#", link):
            return match[0]
        path = link.split("#")[0]
        example = re.search(r"examples/(\w+)/README\.md$", path)
        if example:
            up = "../" * page.file.src_uri.count("/")
            return f"[{text}]({up}examples/{example[1]}/{example[1]}.md)"
        here = Path(page.file.src_uri).parent / path
        if "README.md" in page.file.src_uri or files.get_file_from_path(_normal(str(here))):
            return match[0]
        return f"{text} (`{_in_repository(page, path)}`)" if _in_repository(page, path) != text.strip("`") else text

    # Not in code.
    parts = re.split(r"(^```.*?^```$|`[^`\n]+`(?!\]))", markdown, flags=re.M | re.S)
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"(?<!!)\[([^\]\n]+)\]\(([^)\s]+)\)", target, parts[i])
    return "".join(parts)


def not_listed(markdown: str) -> str:
    """Names of the Python package that the page has in none of its sections."""
    text = (ROOT / "apps/python/python/halfarrow/__init__.py").read_text()
    names = re.findall(r'^    "([A-Za-z]\w*)",$', text, re.M)
    left = [name for name in names if not re.search(rf"^::: halfarrow\.(model\.)?{name}$", markdown, re.M)]
    return "\n## More\n\n" + "".join(f"::: halfarrow.{name}\n\n" for name in left) if left else ""


def _normal(path: str) -> str:
    parts: list[str] = []
    for part in path.split("/"):
        if part == ".." and parts and parts[-1] != "..":
            parts.pop()
        elif part not in (".", ""):
            parts.append(part)
    return "/".join(parts)


def _in_repository(page: Any, path: str) -> str:
    uri = page.file.src_uri
    example = re.match(r"examples/(\w+)/\w+\.md", uri)
    model = re.match(r"models/(\w+)\.md", uri)
    base = f"examples/{example[1]}" if example else f"models/{model[1]}" if model else f"docs/{Path(uri).parent}"
    return _normal(f"{base}/{path}")
