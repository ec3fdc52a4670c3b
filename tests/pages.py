"""A page as a test reads it: its elements with their attributes and text, in order."""

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

from django.http import HttpResponse, HttpResponseBase
from django.test import Client

OUR_SCRIPT = re.compile(r"/static/[\w./-]+\.js")
VOID = {"col", "meta", "link", "input", "br", "hr", "img", "path", "rect", "source", "mspace", "wbr"}


@dataclass
class Element:
    """One element: tag, attributes, and all the text inside it with single spaces."""

    tag: str
    attributes: dict[str, str]
    raw_text: str = field(default="", repr=False)
    children: "list[Element]" = field(default_factory=list, repr=False)

    @property
    def text(self) -> str:
        return " ".join(self.raw_text.split())

    @property
    def classes(self) -> list[str]:
        return self.attributes.get("class", "").split()

    def all(self, tag: str, **attributes: str) -> "list[Element]":
        """Every descendant with this tag and these attributes (`class_` asks for one of the classes)."""
        wanted_class = attributes.pop("class_", None)
        matches = []
        for child in self.children:
            if (
                child.tag == tag
                and all(child.attributes.get(name) == value for name, value in attributes.items())
                and (wanted_class is None or wanted_class in child.classes)
            ):
                matches.append(child)
            matches.extend(child.all(tag, **attributes, **({"class_": wanted_class} if wanted_class else {})))
        return matches

    def one(self, tag: str, **attributes: str) -> "Element":
        (match,) = self.all(tag, **attributes)
        return match

    def everything(self) -> "list[Element]":
        return [each for child in self.children for each in (child, *child.everything())]


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.root = Element("", {})
        self.open = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].children.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open[-1].children.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            closed = self.open.pop()
            assert closed.tag == tag, f"<{closed.tag}> is closed by </{tag}> at {self.getpos()}"

    def handle_data(self, data: str) -> None:
        for element in self.open:
            element.raw_text += data


def read(html: str) -> Element:
    """The page's tree; fails on tags that do not nest."""
    reader = _Reader()
    reader.feed(html)
    assert reader.open == [reader.root], f"never closed: {[e.tag for e in reader.open[1:]]}"
    return reader.root


def page(response: HttpResponseBase) -> Element:
    """The page in a response."""
    assert isinstance(response, HttpResponse)
    return read(response.content.decode())


def get(client: Client, address: str = "/board/test/", status: int = 200) -> Element:
    """The page at an address, which is answered with this status."""
    response = client.get(address)
    assert response.status_code == status, address
    return page(response)


def strange_scripts(root: Element) -> list[Element]:
    """The scripts here that are more or other than a file of ours: nobody's text may become one."""
    return [
        script
        for script in root.all("script")
        if script.raw_text.strip() or not OUR_SCRIPT.fullmatch(script.attributes.get("src", ""))
    ]


def board_rows(root: Element) -> list[list[str]]:
    """The board as texts, without what is only spoken, drawn, or to be ticked."""
    rows = []
    for row in root.one("table", class_="board").one("tbody").all("tr"):
        cells = []
        for cell in row.children:
            if {"interval", "choose"} & set(cell.classes):
                continue
            spoken = " ".join(e.text for e in cell.all("span", class_="spoken"))
            cells.append(cell.text.removesuffix(spoken).strip())
        rows.append(cells)
    return rows


def column(root: Element, index: int) -> list[str]:
    """One column of the board."""
    return [row[index] for row in board_rows(root)]
