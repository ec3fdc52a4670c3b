"""The guides of `docs/` as pages: their order and links."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from django.conf import settings
from django.templatetags.static import static
from django.urls import Resolver404, resolve, reverse

from leaderboard.web import markdown
from leaderboard.web.docs import api_examples, python_reference
from leaderboard.web.markdown import Document

_REPOSITORY: Final = Path(settings.BASE_DIR)
_DOCS: Final = _REPOSITORY / "docs"
_EXAMPLES: Final = _REPOSITORY / "examples"
# By file: the name in the address where the file's own would say nothing, or stand for another page.
_NAMES: Final = {"index": "overview", "api": "api-guide", "adr/README": "decisions"}
# The sections of the navigation: titles, and names of guides.
_SECTIONS: Final[dict[str, dict[str, str]]] = {
    "For everyone": {"Overview": "overview", "FAQ": "faq", "Compared with other leaderboards": "peers"},
    "For researchers": {
        "Quick start for researchers": "researchers",
        "Train a network": "training",
        "Baselines": "baselines",
        "Reproduce the paper": "reproduce",
        "Deep Scale": "deep-scale",
        "Models": "models",
        "Annotation": "annotation",
        "Prediction files": "file-format",
        "Command line": "cli",
        "Python": "python",
        "Python reference": "python-reference",
        "Baselines reference": "baselines-reference",
        "CI": "ci",
        "API guide": "api-guide",
        "API reference": "",
        "Problem codes": "problem-codes",
        "Exports": "exports",
        "Teams, quotas, tokens": "access",
    },
    "The numbers": {
        "Scoring": "scoring",
        "Uncertainty": "uncertainty",
        "Validation": "validation",
        "Editions": "editions",
        "Changelog": "changelog",
    },
    "For maintainers": {
        "Quick start for maintainers": "hosting",
        "Maintenance": "maintainers",
        "Backups and upgrades": "backups",
        "Operations": "operations",
        "Settings": "settings",
        "Host another dataset": "another-dataset",
        "Capacity": "capacity",
        "Security": "security",
        "Hidden values": "hidden-values",
        "Reliability": "reliability",
    },
    "For developers": {
        "Architecture": "architecture",
        "Extending": "extending",
        "Decisions": "decisions",
    },
}
# Pages that a guide names by their paths, and that anybody may ask for.
_PAGES: Final = frozenset(
    (
        *("account", "account_data", "mails", "submissions", "submit", "team", "tokens"),
        *("api-root", "api-schema", "api_reference", "docs"),
        *("compare", "dist", "feed_of_all", "published", "site_page"),
    )
)
_SCHEMES: Final = {"http", "https", "mailto"}
_VIEW_BOX: Final = re.compile(r'viewBox="0 0 ([0-9.]+) ([0-9.]+)"')


class DeadLink(Exception):
    """A guide links to a file that is no page and no example."""


@dataclass(frozen=True)
class GuideLink:
    """A line of the navigation; `name` is empty for a page that is no guide."""

    title: str
    address: str
    name: str = ""


@cache
def files() -> dict[str, Path]:
    paths = {
        _NAMES.get(name, name): path
        for path in (*_DOCS.glob("*.md"), *_DOCS.glob("adr/*.md"))
        for name in [path.relative_to(_DOCS).with_suffix("").as_posix()]
    }
    return {**paths, "examples": _EXAMPLES / "README.md", "changelog": _REPOSITORY / "CHANGELOG.md"}


@cache
def _names() -> dict[Path, str]:
    return {path: name for name, path in files().items()}


@cache
def navigation() -> list[tuple[str, list[GuideLink]]]:
    """Return the side navigation: links below titles, the first title empty."""
    first = [
        GuideLink("At a glance", reverse("docs")),
        GuideLink("Install", reverse("dist")),
    ]
    return [
        ("", first),
        *((title, [_entry(*each) for each in pages.items()]) for title, pages in _SECTIONS.items()),
    ]


def _entry(title: str, name: str) -> GuideLink:
    address = reverse("guide", args=[name]) if name else reverse("api_reference")
    return GuideLink(title, address, name)


def neighbours(name: str) -> tuple[GuideLink | None, GuideLink | None]:
    """Return the guides before and after this one; decisions follow their list."""
    entries = [entry for _, links in navigation() for entry in links]
    if name.startswith("adr/"):
        decisions = sorted(each for each in files() if each.startswith("adr/"))
        entries = [_entry("Decisions", "decisions"), *(_entry(guide(each).title, each) for each in decisions)]
    at = next((n for n, entry in enumerate(entries) if entry.name == name), None)
    if at is None:
        return None, None
    return entries[at - 1], entries[at + 1] if at + 1 < len(entries) else None


@cache
def guide(name: str) -> Document:
    """Render a guide, once in a process. Raises `KeyError`."""
    path = files()[name]
    text = path.read_text(encoding="utf-8").replace(api_examples.SITE, settings.SITE_URL)
    if name in python_reference.SECTIONS:
        text = f"{text}\n{python_reference.text(name)}"

    def link(address: str) -> str:
        return _link(address, source=path)

    return markdown.guide(text, link=link, image=_image, path=_page)


def _page(path: str) -> str:
    """Return the path of a page of this site again, and of anything else an empty text."""
    try:
        return path if path.startswith("/") and resolve(path).view_name in _PAGES else ""
    except Resolver404:
        return ""


def _link(address: str, *, source: Path) -> str:
    parts = urlsplit(address)
    if parts.scheme in _SCHEMES or address.startswith("#"):
        return address
    target = (source.parent / parts.path).resolve()
    anchor = f"#{parts.fragment}" if parts.fragment else ""
    if target in _names():
        return reverse("guide", args=[_names()[target]]) + anchor
    if target.is_relative_to(_EXAMPLES) and target.is_file():
        return static(f"examples/{target.relative_to(_EXAMPLES).as_posix()}")
    raise DeadLink(f"{source.relative_to(_REPOSITORY)} links to {address}; expected a guide or an example")


def _image(address: str) -> dict[str, str]:
    """Return address and size of a figure, so that nothing moves when it is loaded."""
    drawn = (_DOCS / address).read_text(encoding="utf-8")
    size = _VIEW_BOX.search(drawn)
    if size is None:
        raise DeadLink(f"{address} has no viewBox; expected a drawing with one")
    width, height = (str(round(float(number))) for number in size.groups())
    source = static(f"docs/{address.removeprefix('figures/')}")
    return {"src": source, "width": width, "height": height, "loading": "lazy"}
