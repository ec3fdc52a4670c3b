"""Escaping of foreign texts in LaTeX (ASCII), BibTeX, Markdown and CSV: shown as they are, without effect."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from itertools import groupby
from typing import Final

_COMMANDS: Final = {
    "\\": r"\textbackslash{}",
    "{": r"\textbraceleft{}",  # named: BibTeX counts braces, also those behind a backslash
    "}": r"\textbraceright{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_"},
    # What the first fonts of TeX have something else in the place of, and what would join with its neighbour.
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedblright{}",
    "`": r"\textquoteleft{}",
    "–": r"\textendash{}",
    "—": r"\textemdash{}",
    "‘": r"\textquoteleft{}",
    "’": r"\textquoteright{}",
    "“": r"\textquotedblleft{}",
    "”": r"\textquotedblright{}",
    "…": r"\ldots{}",
    "ß": r"\ss{}",
    "æ": r"\ae{}",
    "Æ": r"\AE{}",
    "œ": r"\oe{}",
    "Œ": r"\OE{}",
    "ø": r"\o{}",
    "Ø": r"\O{}",
    "ł": r"\l{}",
    "Ł": r"\L{}",
    "ı": r"\i{}",
    "©": r"\copyright{}",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "±": r"$\pm$",
    "−": "$-$",
    "→": r"$\to$",
    "↓": r"$\downarrow$",
    "↑": r"$\uparrow$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "°": r"$^{\circ}$",
    "∞": r"$\infty$",
    "†": r"\dag{}",
    "‡": r"\ddag{}",
    "§": r"\S{}",
}
_ACCENTS: Final = {
    "\u0300": "`",
    "\u0301": "'",
    "\u0302": "^",
    "\u0303": "~",
    "\u0304": "=",
    "\u0306": "u",
    "\u0307": ".",
    "\u0308": '"',
    "\u030a": "r",
    "\u030b": "H",
    "\u030c": "v",
    "\u0327": "c",
}
_SUPERSCRIPTS: Final = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-", strict=True))
_CAPITALS: Final = "ΓΔΘΛΞΠΣΦΨΩ"  # the others look like Latin letters, and have no command
_GREEK: Final = {
    letter: rf"$\{name.title() if letter in _CAPITALS else name}$"
    for letter in f"αβγδεζηθικλμνξπρστυφχψω{_CAPITALS}"
    for name in [unicodedata.name(letter).split()[-1].lower().replace("lamda", "lambda")]
}
# A spreadsheet takes a cell that begins like this for a formula and runs it; the wide forms as well. Where
# a comma is the decimal sign, lines are split at semicolons or tabs: there a cell begins behind each of them.
_FORMULA: Final = re.compile(r"(?P<before>[;\t\r\n|])(?=[\s\"']*[=+\-@＝＋－＠])")
_FORMULA_AT_START: Final = re.compile(r"[ \"]*[=+\-@\t\r\n＝＋－＠]")
# A number of a table that must stay one; everything else is a text.
_CSV_NUMBER: Final = re.compile(r"[0-9]+(\.[0-9]+)?")
# What is markup wherever it stands in a line; "#" and "$" on GitHub (a number of an issue, mathematics).
_MARKDOWN: Final = re.compile(r"([\\`*_\[\]|~#$])")
# What makes a list, a heading or a rule of a line that begins with it.
_MARKDOWN_START: Final = re.compile(r"^([0-9]{1,9}(?=[.)](?: |$))|(?=[-+=]))")
_WEB_ADDRESS: Final = re.compile(r"https?://[!-;=?-~]+")


def one_line(text: str) -> str:
    """Put a text on one line, without invisible or direction-changing characters.

    >>> one_line("Deep\\n Scale\\u202e")
    'Deep Scale'
    """
    seen = "".join(c if c.isprintable() else " " for c in text if unicodedata.category(c) != "Cf")
    return " ".join(seen.split())


def latex(text: str) -> str:
    r"""Escape a text for LaTeX; unsupported characters become code points.

    >>> print(latex("50 % of x_1 & Müller–Łoś β 中"))
    50 \% of x\_1 \& M\"{u}ller\textendash{}\L{}o\'{s} $\beta$ [U+4E2D]
    >>> print(latex("12.5 ×10⁻⁴"))
    12.5 $\times$10$^{-4}$
    """
    line = unicodedata.normalize("NFC", one_line(text))
    printed = "".join(
        f"$^{{{''.join(map(_SUPERSCRIPTS.__getitem__, characters))}}}$"
        if is_superscript
        else "".join(map(_latex_character, characters))
        for is_superscript, characters in groupby(line, key=_SUPERSCRIPTS.__contains__)
    )
    # Two of these would be printed as one longer mark.
    return re.sub(r"-(?=-)|'(?=')", r"\g<0>{}", printed)


def _latex_character(character: str) -> str:
    known = _COMMANDS.get(character) or _GREEK.get(character)
    if known is not None:
        return known
    if character.isascii():
        return character
    base, *marks = list(unicodedata.normalize("NFKD", character))
    if base.isascii() and base.isalnum() and all(mark in _ACCENTS for mark in marks):
        for mark in marks:
            base = f"\\{_ACCENTS[mark]}{{{base}}}"
        return base
    return f"[U+{ord(character):04X}]"


def latex_comment(text: str) -> str:
    return f"% {one_line(text)}".rstrip()


def markdown(text: str) -> str:
    r"""Escape a text for Markdown and its tables: no markup, no automatic links.

    >>> print(markdown("a|b *c* <i> www.example.org"))
    a\|b \*c\* &lt;i&gt; www&#46;example.org
    """
    plain = re.sub(r"&(?=#?\w+;)", "&amp;", one_line(text)).replace("<", "&lt;").replace(">", "&gt;")
    plain = _MARKDOWN.sub(r"\\\1", plain)
    plain = _MARKDOWN_START.sub(r"\1\\", plain)
    plain = re.sub(r"(?i)\b(www)\.", r"\1&#46;", plain)
    return plain.replace("://", "&#58;//").replace("@", "&#64;")


def markdown_address(url: str) -> str:
    """Make a Markdown link of an own address; other text stays text.

    >>> print(markdown_address("https://example.org/board/test/?sort=rte"), markdown_address("<b>"))
    <https://example.org/board/test/?sort=rte> &lt;b&gt;
    """
    return f"<{url}>" if _WEB_ADDRESS.fullmatch(url) else markdown(url)


def guarded(text: str) -> str:
    """Guard a text from being read as a formula by a spreadsheet.

    >>> guarded("=1+1"), guarded("Deep Scale"), guarded("A;=1+1;B")
    ("'=1+1", 'Deep Scale', "A;'=1+1;B")
    """
    inside = _FORMULA.sub(r"\g<before>'", text)
    return f"'{inside}" if _FORMULA_AT_START.match(inside) else inside


def csv_cell(value: object) -> str:
    """Format a cell of a CSV table (RFC 4180); texts are guarded and quoted, None is empty.

    >>> print(csv_cell(15.03), csv_cell("15.03"), csv_cell(None), csv_cell("A;=1"), csv_cell('a "b" c'))
    15.03 15.03  "A;'=1" "a ""b"" c"
    """
    if value is None or value == "":
        return ""
    text = str(value)
    if isinstance(value, bool | int | float) or _CSV_NUMBER.fullmatch(text):
        return text
    doubled = guarded(text).replace('"', '""')
    return f'"{doubled}"'


def csv_line(cells: Iterable[object], *, end: str = "\r\n") -> str:
    return ",".join(map(csv_cell, cells)) + end
