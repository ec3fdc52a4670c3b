"""The guides of `docs/` as pages: which there are, how they follow each other, and where their links lead.

`mkdocs.yml` has the navigation, so that the site and `make docs` show the same one.
"""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import yaml
from django.conf import settings
from django.templatetags.static import static
from django.urls import reverse

from leaderboard.web import markdown
from leaderboard.web.markdown import Document

_REPOSITORY: Final = Path(settings.BASE_DIR)
_DOCS: Final = _REPOSITORY / "docs"
_EXAMPLES: Final = _REPOSITORY / "examples"
_REFERENCE: Final = _DOCS / "api-reference.md"
# Its place in the navigation, and where it is.
_CHANGELOG: Final = "changelog.md"
_CHANGELOG_FILE: Final = _REPOSITORY / "CHANGELOG.md"
# By file: the name in the address where the file's own would say nothing, or stand for another page.
_NAMES: Final = {"index": "overview", "api": "api-guide", "adr/README": "decisions"}
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


@dataclass(frozen=True)
class Section:
    """Some lines of the navigation below a common title, which may be empty."""

    title: str
    entries: tuple[GuideLink, ...]


@cache
def files() -> dict[str, Path]:
    """Every guide by its name in addresses."""
    found = {
        _NAMES.get(name, name): path
        for path in (*_DOCS.glob("*.md"), *_DOCS.glob("adr/*.md"))
        for name in [path.relative_to(_DOCS).with_suffix("").as_posix()]
    }
    return {**found, "examples": _EXAMPLES / "README.md", "changelog": _CHANGELOG_FILE}


@cache
def _names() -> dict[Path, str]:
    return {path: name for name, path in files().items()}


@cache
def navigation() -> tuple[Section, ...]:
    """The side of every page of the documentation."""
    listed = yaml.safe_load((_REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    first = [GuideLink("At a glance", reverse("docs")), GuideLink("Install", reverse("dist"))]
    sections = []
    for item in listed:
        ((title, inside),) = item.items()
        if isinstance(inside, str):
            first.append(_entry(title, inside))
        else:
            sections.append(Section(title, tuple(_entry(*next(iter(each.items()))) for each in inside)))
    return (Section("", tuple(first)), *sections)


def _entry(title: str, file: str) -> GuideLink:
    if _DOCS / file == _REFERENCE:
        return GuideLink(title, reverse("api_reference"))
    name = _names()[_CHANGELOG_FILE if file == _CHANGELOG else _DOCS / file]
    return GuideLink(title, reverse("guide", args=[name]), name)


def neighbours(name: str) -> tuple[GuideLink | None, GuideLink | None]:
    """The guides before and after this one in the navigation."""
    entries = [entry for section in navigation() for entry in section.entries]
    at = next((n for n, entry in enumerate(entries) if entry.name == name), None)
    if at is None:
        return None, None
    return entries[at - 1], entries[at + 1] if at + 1 < len(entries) else None


@cache
def guide(name: str) -> Document:
    """The guide of this name, drawn once in the life of the process. Raises `KeyError` for any other name."""
    path = files()[name]

    def link(address: str) -> str:
        return _link(address, source=path)

    return markdown.guide(path.read_text(encoding="utf-8"), link=link, image=_image)


def _link(address: str, *, source: Path) -> str:
    """Where a link in a file leads on the site. Raises `DeadLink`."""
    parts = urlsplit(address)
    if parts.scheme in _SCHEMES or address.startswith("#"):
        return address
    target = (source.parent / parts.path).resolve()
    place = f"#{parts.fragment}" if parts.fragment else ""
    if target in _names():
        return reverse("guide", args=[_names()[target]]) + place
    if target == _REFERENCE:
        return reverse("api_reference") + place
    if target.is_relative_to(_EXAMPLES) and target.is_file():
        return static(f"examples/{target.relative_to(_EXAMPLES).as_posix()}")
    raise DeadLink(f"{source.relative_to(_REPOSITORY)} links to {address}; expected a guide or an example")


def _image(address: str) -> dict[str, str]:
    """The static file of a figure in `docs/figures/`, and its size, so that nothing moves when it arrives."""
    drawn = (_DOCS / address).read_text(encoding="utf-8")
    size = _VIEW_BOX.search(drawn)
    if size is None:
        raise DeadLink(f"{address} has no viewBox; expected a drawing with one")
    width, height = (str(round(float(number))) for number in size.groups())
    source = static(f"docs/{address.removeprefix('figures/')}")
    return {"src": source, "width": width, "height": height, "loading": "lazy"}
