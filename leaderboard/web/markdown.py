"""Markdown as HTML, with anchors and scrolling tables; HTML in a text is shown as text."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final

from django.utils.safestring import SafeString
from django.utils.text import slugify
from markdown_it import MarkdownIt
from markdown_it.token import Token

from leaderboard.web import equations
from leaderboard.web.formatting import lined, unbroken

Target = Callable[[str], str]
# Where links may lead: pages of any host, mail, and places on this site.
_TARGET: Final = re.compile(r"(?:https?:|mailto:|/|#|\?)", re.IGNORECASE)
# A cell up to so many characters stays in one line; a longer one than the second number gets a column's room.
_MAX_TOGETHER: Final = 14
_MIN_WRAPS: Final = 40
# An option or a name in code, which a browser would break at its hyphens.
_CODE: Final = re.compile(r"<code\b.*?</code>", re.DOTALL)
# A long name or path, in code or a heading: it breaks at dots, slashes and underscores, not before an ending.
_NAMES: Final = re.compile(r"(?<=<code>)[^<]+(?=</code>)|(?<=>)[^<]+(?=</h3>)")
_LONG: Final = re.compile(r"\S{24,}")
_JOINT: Final = re.compile(r"(?<=[\w}][/_])(?=[\w{])|(?<=\w\.)(?=\w{5})")
_HYPHENED: Final = re.compile(r"(?<=[\s>\[])(?:--?[a-z]|[A-Za-z]+-)[\w-]*")
_NUMBERED: Final = re.compile(r"<tr>\n<td>\d+</td>\n<td[^>]*>[^\n]*</td>\n</tr>")
_TABLE: Final = re.compile(r"<table>\n(.*?)</table>", re.DOTALL)


@dataclass(frozen=True)
class TextHeading:
    """A heading; level 1 is the title."""

    level: int
    text: str
    anchor: str


@dataclass(frozen=True)
class Part:
    """The plain text below one heading, for the search: the prose is a line, then each row, then code."""

    heading: TextHeading
    text: str
    prose: str = ""


@dataclass(frozen=True)
class Document:
    html: SafeString
    parts: tuple[Part, ...]

    @property
    def title(self) -> str:
        return next((part.heading.text for part in self.parts if part.heading.level == 1), "")

    @property
    def chapters(self) -> list[TextHeading]:
        return [part.heading for part in self.parts if part.heading.level == 2]


def guide(
    text: str, *, link: Target, image: Callable[[str], Mapping[str, str]], path: Target = lambda _: ""
) -> Document:
    """Render a guide of the project; a block of code in the language `math` is an equation.

    `link` returns the target of an address, `image` the attributes of a picture, and `path` the page that
    inline code names, if any.
    """
    tokens = _parser(images=True).parse(text)
    for token in _inline(tokens):
        if "href" in token.attrs:
            token.attrSet("href", link(str(token.attrs["href"])))
        if "src" in token.attrs:
            token.attrs.update(image(str(token.attrs["src"])))
    for token in tokens:
        if token.type == "fence" and token.info == "math":
            token.type, token.content = "html_block", equations.mathml(token.content)
        if token.children and [child.type for child in token.children] == ["image"]:
            figure = token.children[0]  # it links to itself, where it can be enlarged
            token.children = _linked(figure, str(figure.attrs["src"]), **{"class": "figure"})
        _typeset(token.children or [])
        token.children = _paths_linked(token.children or [], path)
    return _document(tokens, _parser(images=True))


def _typeset(children: Sequence[Token]) -> None:
    """Turn $`code`$ into an equation within its line."""
    for before, code, after in zip(children, children[1:], children[2:], strict=False):
        if code.type == "code_inline" and before.content.endswith("$") and after.content.startswith("$"):
            before.content, after.content = before.content[:-1], after.content[1:]
            code.type, code.content = "html_inline", equations.mathml(code.content, display="inline")


def _paths_linked(children: Sequence[Token], path: Target) -> list[Token]:
    """Make links of inline code that names a page, outside of other links."""
    drawn, depth = list[Token](), 0
    for child in children:
        depth += child.nesting if child.type in {"link_open", "link_close"} else 0
        page = path(child.content) if child.type == "code_inline" and not depth else ""
        drawn += _linked(child, page) if page else [child]
    return drawn


def _linked(token: Token, href: str, **attrs: str) -> list[Token]:
    return [Token("link_open", "a", 1, attrs={"href": href, **attrs}), token, Token("link_close", "a", -1)]


def page(text: str) -> Document:
    """Render a text of a maintainer, without images and title."""
    parser = _parser(images=False)
    tokens = parser.parse(text)
    for token in tokens:
        if token.type in {"heading_open", "heading_close"} and token.tag == "h1":
            token.tag = "h2"
    for token in _inline(tokens):
        if "href" in token.attrs and not _TARGET.match(str(token.attrs["href"])):
            token.attrSet("href", "#")
    return _document(tokens, parser)


def _label_cells(tokens: Sequence[Token]) -> None:
    """Give each cell but a row's first the head of its column, which a phone shows next to it."""
    heads, column = list[str](), 0
    for token, inline in pairwise(tokens):
        if token.type == "thead_open":
            heads = []
        elif token.type == "tr_open":
            column = 0
        elif token.type == "th_open":
            heads.append(_plain(inline))
        elif token.type == "td_open":
            if column and heads[column]:
                token.attrSet("data-label", heads[column])
            column += 1


@cache
def _parser(*, images: bool) -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False, "typographer": True})
    parser.enable(["table", "strikethrough", "smartquotes"])
    return parser if images else parser.disable("image")


def _inline(tokens: Sequence[Token]) -> list[Token]:
    return [child for token in tokens for child in token.children or ()]


def _document(tokens: list[Token], parser: MarkdownIt) -> Document:
    """Add anchors of headings and classes of tables, and collect the plain text of each part."""
    parts: list[Part] = []
    heading, anchors = TextHeading(0, "", ""), set[str]()
    prose, rows, code = list[str](), list[str](), list[str]()

    def part() -> Part:
        # Items of a list may have no full stop.
        sentences = re.sub(r"(?<=[\w)]) \n", " · ", " \n".join(prose)).replace("\n", "")
        return Part(heading, "\n".join(filter(None, [sentences, *rows, *code])), sentences)

    _label_cells(tokens)
    for at, token in enumerate(tokens):
        if token.type == "heading_open":
            parts.append(part())
            words = _plain(tokens[at + 1])
            heading = TextHeading(int(token.tag[1]), words, _anchor(words, anchors))
            prose, rows, code = [], [], []
            token.attrSet("id", heading.anchor)
        elif token.type in {"fence", "code_block"}:
            code.append(token.content)
            _draw_code(token)
        elif token.type == "tr_open":
            rows.append("")
        elif token.type == "inline" and tokens[at - 1].type != "heading_open":
            if tokens[at - 1].type in {"th_open", "td_open"}:
                rows[-1] += _cell(token)
            else:
                prose.append(_plain(token))
        elif token.type in {"th_open", "td_open"}:
            _shape(token, tokens[at + 1])
            if not tokens[at + 1].content:
                token.tag = tokens[at + 2].tag = "td"  # a head without words names nothing
    parts.append(part())
    _keep_values(tokens)
    html = parser.renderer.render(tokens, parser.options, {})
    html = _NAMES.sub(lambda name: _LONG.sub(lambda long: _JOINT.sub("<wbr>", long[0]), name[0]), html)
    html = _CODE.sub(lambda code: _HYPHENED.sub(r'<span class="together">\g<0></span>', code[0]), html)
    html = _TABLE.sub(_framed, html)
    # The parser escapes what is no markup of its own.
    drawn = SafeString(html)
    return Document(drawn, tuple(part for part in parts if part.heading.level or part.text))


def _keep_values(tokens: Sequence[Token]) -> None:
    """Keep intervals and numbers with units on one line, also where the source breaks; code stays."""
    inline = _inline(tokens)
    for before, gap, after in zip(inline, inline[1:], inline[2:], strict=False):
        if gap.type == "softbreak" and before.type == after.type == "text":
            after.content = f"{before.content} {after.content}"
            before.content, gap.type = "", "text"
    for child in inline:
        if child.type == "text":
            child.content = unbroken(child.content).replace("SHA-256", "SHA\N{NON-BREAKING HYPHEN}256")


def _draw_code(token: Token) -> None:
    """Draw the lines of an output or a synopsis, which nobody copies; without a language, code is one.

    A line breaks where the page is narrow, but not one with columns.
    """
    token.type, token.info = "fence", token.info or "text"
    if token.info in {"text", "console"}:
        lines = lined(token.content)
        frame = '<pre tabindex="0">' if "tabular" in lines else "<pre>"
        drawn = f'{frame}<code class="language-{token.info}">{lines}</code></pre>\n'
        token.type, token.content = "html_block", drawn


def _framed(table: re.Match[str]) -> str:
    """Let a table scroll; one with sentences becomes cards on a phone, if it is no numbered list."""
    is_list = 'class="wraps"' not in table[1] or _NUMBERED.search(table[1])
    kind = "list" if is_list else "list cards"
    frame = '<div class="scroll" tabindex="0" role="group" aria-label="Table">'
    return f'{frame}\n<table class="{kind}">\n{table[1]}</table>\n</div>'


def _shape(cell: Token, inline: Token) -> None:
    """Keep a short cell in one line, and give a long one room."""
    if "right" in str(cell.attrs.pop("style", "")):
        cell.attrJoin("class", "number")
    words = _plain(inline)
    if cell.tag == "td" and (len(words) <= _MAX_TOGETHER or " ± " in words):
        for child in inline.children or ():
            child.content = child.content.replace(" ", "\N{NO-BREAK SPACE}")
    elif cell.tag == "td" and len(words) > _MIN_WRAPS:
        cell.attrJoin("class", "wraps")


def _plain(token: Token) -> str:
    return "".join(
        child.content if child.type in {"text", "code_inline"} else " "
        for child in token.children or ()
        if child.type in {"text", "code_inline", "softbreak", "hardbreak"}
    )


def _cell(token: Token) -> str:
    # The search shows a row as one line: cells need a separator.
    words = _plain(token)
    return f"{words} · " if any(map(str.isalnum, words)) else ""


def _anchor(words: str, taken: set[str]) -> str:
    """Make the anchor of a heading, as most Markdown programs do.

    >>> _anchor("Who sees a method?", set()), _anchor("`check`", {"check"})
    ('who-sees-a-method', 'check_1')
    """
    first = slugify(words) or "part"
    anchor, n_before = first, 0
    while anchor in taken:
        n_before += 1
        anchor = f"{first}_{n_before}"
    taken.add(anchor)
    return anchor
