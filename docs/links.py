"""Links of the site that lead nowhere: python docs/links.py lists those of docs/site."""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

SITE = Path(__file__).parent / "site"


class _Page(HTMLParser):
    """Places of a page that links may name, and its links to files of the site."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.places: set[str] = set()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        self.links += [given[name] for name in ("href", "src") if name in given]


def dead(site: Path) -> list[str]:
    """Each link within a site whose file or place is not there, behind the page that has it."""
    pages = {path.resolve(): _Page(path.read_text(encoding="utf8")) for path in site.rglob("*.html")}
    found = []
    for path, page in sorted(pages.items()):
        for link in dict.fromkeys(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            file = unquote(parts.path)
            target = path if not file else (site / file[1:] if file[0] == "/" else path.parent / file).resolve()
            target = target / "index.html" if target.is_dir() else target
            place = unquote(parts.fragment)
            if not target.exists() or (place and target in pages and place not in pages[target].places):
                found.append(f"{path.relative_to(site.resolve())}: {link}")
    return found


if __name__ == "__main__":
    sys.exit("\n".join(dead(SITE)) or 0)
