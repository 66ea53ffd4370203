"""Check the links of the built site: `python docs/check_links.py docs/_build`.

Internal links must lead to a file, and to an anchor in it. External addresses are checked for
their form only, so that no network is needed.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what a tag refers to and is referred to by."""
        for name, value in attrs:
            if name in ("href", "src") and value and not value.startswith("data:"):
                self.links.append(value)
            elif name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value or "")


def broken_links(site: Path) -> list[str]:
    """Links that lead nowhere, each with its page."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    found = []
    for path, page in sorted(pages.items()):
        found += [f"{path.relative_to(site)}: {link}" for link in page.links
                  if not _leads_somewhere(path, link, pages)]  # fmt: skip
    return found


def _leads_somewhere(path: Path, link: str, pages: dict[Path, _Page]) -> bool:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return parts.scheme in ("http", "https", "mailto") and bool(parts.netloc or parts.path)
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path.resolve()
    if not target.is_file():
        return False
    known = {page.resolve(): found for page, found in pages.items()}.get(target)
    return not parts.fragment or known is None or unquote(parts.fragment) in known.anchors


def main(site: str) -> int:
    """Print the broken links; the exit status says whether there are any."""
    pages = len(list(Path(site).rglob("*.html")))
    broken = broken_links(Path(site))
    print(*broken, f"{len(broken)} broken links on {pages} pages", sep="\n")
    return 1 if broken or not pages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "docs/_build"))
