#!/usr/bin/env python3
"""Whether the built site works without a network: nothing is loaded from elsewhere, and what pages point to is there."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from program import ROOT

SITE = ROOT / "site"
LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "src", "object": "data"}


class Page(HTMLParser):
    """What a page loads, what it links to, and the places in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attributes}
        if "id" in given:
            self.places.add(given["id"])
        if tag in LOADS and LOADS[tag] in given:
            self.loads.append(given[LOADS[tag]])
        elif tag == "link" and given.get("rel") not in ("canonical", "prev", "next", "alternate"):
            self.loads.append(given.get("href", ""))
        elif tag == "a" and "href" in given:
            self.links.append(given["href"])


def main() -> int:
    texts = {path: path.read_text() for path in SITE.rglob("*.html")}
    pages = {path: Page(text) for path, text in texts.items()}
    faults = []
    for path, page in pages.items():
        name = path.relative_to(SITE)
        for target in [*page.loads, *page.links]:
            parts = urlsplit(target)
            if parts.scheme == "data":
                continue
            if parts.scheme or parts.netloc:
                if target in page.loads:
                    faults.append(f"{name} loads {target}")
                continue
            # The page for what is not found has paths from the root.
            start = SITE if parts.path.startswith("/") else path.parent
            to = (start / unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            if not to.exists():
                faults.append(f"{name}: {target} is not there")
            elif parts.fragment and to in pages and unquote(parts.fragment) not in pages[to].places:
                # Places of animations are times.
                if "=" not in parts.fragment and parts.fragment != "__skip":
                    faults.append(f"{name}: {target} has no such place")
        faults += [f"{name} has {found}" for found in re.findall(r"@import[^;]*http[^;]*|url\(['\"]?http[^)]*", texts[path])]
    for path in SITE.rglob("*.css"):
        faults += [f"{path.relative_to(SITE)} loads {u}" for u in re.findall(r"url\(['\"]?(https?:[^)]*)", path.read_text())]
    for fault in faults:
        print(fault, file=sys.stderr)
    print(f"{len(pages)} pages, {len(faults)} faults")
    return 1 if faults or not pages else 0


if __name__ == "__main__":
    sys.exit(main())
