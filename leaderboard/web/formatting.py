"""Times and counts on every page."""

import re
from collections.abc import Collection, Iterable
from datetime import UTC, datetime, time
from typing import Final

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from evaluator import format_rounded
from evaluator.counting import counted
from leaderboard.boards.rows import ConfidenceInterval

_UNITS = r"[mn]?s|c?m|Hz|[KMG]i?B|TB|bits?|px|seconds?|minutes?|hours?|days?|weeks?|cores?"
_TOGETHER = re.compile(
    rf"(?<=\d) to (?=[+−]?\d)|(?<=\d) (?=(?:{_UNITS})\b)|(?<= s) [≤<] τ [≤<] (?=−?\d)|(?<=\bp) [=<≥] (?=\d)"
)


# A line break between tags and texts, with what indents the next line; within a tag it parts attributes.
_LINE_BREAK: Final = re.compile(r"\n\s*+(?![^<>]*>)")

# Four words or more, with wide gaps between them.
_COLUMNS = re.compile(r"\S {2,}\S+ {2,}\S+ {2,}\S")


def grouped(value: int | None) -> str:
    """Group thousands, as 28,600."""
    return "" if value is None else f"{value:,}"


def with_noun(value: int, nouns: str) -> str:
    """Format a count and its noun, or one of two, as `person,people`."""
    return counted(value, *nouns.split(","))


def signed(value: float, *, decimals: int = 2) -> str:
    """Format a difference with its sign and a true minus.

    >>> signed(-4.1), signed(0.204), signed(-0.001), signed(-4.1, decimals=1)
    ('−4.10', '+0.20', '0.00', '−4.1')
    """
    text = format_rounded(abs(value), decimals=decimals)
    if not float(text):
        return text
    return f"{'−' if value < 0 else '+'}{text}"


def interval_words(interval: ConfidenceInterval, *, decimals: int = 2) -> str:
    """Word an interval; empty where it is not known.

    >>> interval_words(ConfidenceInterval(low=13.9, high=14.523)), interval_words(ConfidenceInterval())
    ('13.90 to 14.52', '')
    """
    if interval.low is None or interval.high is None:
        return ""
    low, high = (format_rounded(end, decimals=decimals) for end in (interval.low, interval.high))
    return f"{low} to {high}"


def figure_css(texts: Iterable[str]) -> str:
    """Return the class that gives each figure the width of the widest, so that points align.

    >>> figure_css(["9.36", "13.66"])
    'figure w5'
    """
    return f"figure w{max((len(text) for text in texts), default=0)}"


def duration(seconds: float | None) -> str:
    """Format a span of time, as exactly as an estimate deserves.

    >>> duration(0.3), duration(41.8), duration(150), duration(9000)
    ('1 s', '42 s', '3 min', '3 h')
    """
    if seconds is None:
        return ""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{-(-seconds // 60):.0f} min" if seconds < 5400 else f"{-(-seconds // 3600):.0f} h"


def ticked(text: str) -> SafeString:
    """Turn backticks into <code>.

    >>> ticked("The envelope has no `predictions`.")
    'The envelope has no <code>predictions</code>.'
    """
    return _alternating(text.split("`"), "<code>{}</code>")


def _alternating(parts: Iterable[str], every_second: str) -> SafeString:
    pieces = (part if i % 2 == 0 else format_html(every_second, part) for i, part in enumerate(parts))
    return format_html_join("", "{}", ((piece,) for piece in pieces))


def paragraphs(text: str) -> SafeString:
    """Turn a plain text into paragraphs: backticks are code, three around a paragraph a block.

    >>> paragraphs("Needs `tsttc`.")
    '<p>Needs <code>tsttc</code>.</p>'
    >>> paragraphs("A < B\\r\\nC\\n\\n```\\ntsttc check\\n```")
    '<p>A &lt; B<br>C</p><pre><code>tsttc check</code></pre>'
    """
    parts = re.split(r"\n{2,}", text.strip().replace("\r\n", "\n"))
    return format_html_join("", "{}", ((_paragraph(part),) for part in parts))


def _paragraph(text: str) -> SafeString:
    if len(text) > 6 and text.startswith("```") and text.endswith("```"):
        # A line does not break between an option's hyphens and its name.
        pieces = re.split(r"(?<=\s)(--[\w-]+)", text[3:-3].strip())
        return format_html(
            "<pre><code>{}</code></pre>", _alternating(pieces, '<span class="together">{}</span>')
        )
    lines = ((ticked(line),) for line in text.split("\n"))
    return format_html("<p>{}</p>", format_html_join(SafeString("<br>"), "{}", lines))


def with_bold_names(sentence: str, names: Collection[str]) -> SafeString:
    """Set the names of methods off in a sentence, which their commas would break, and keep p with its value.

    >>> with_bold_names("A, fast is 4 lower than B. <", ["B", "A", "A, fast"])
    '<b>A, fast</b> is 4 lower than <b>B</b>. &lt;'
    """
    choices = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    parts = re.split(rf"(?<!\w)({choices})(?!\w)", sentence)
    parts[::2] = [re.sub(r"\bp ([=≤<≥]) (?=\d)", "p\u00a0\\1\u00a0", part) for part in parts[::2]]
    return _alternating(parts, "<b>{}</b>")


def unbroken(text: str) -> str:
    """Keep each interval, each number with its unit and each TTC range on one line.

    >>> unbroken("lower (2.9 to 5.3) with 0 s ≤ τ ≤ 3 s").split(" ")
    ['lower', '(2.9\\xa0to\\xa05.3)', 'with', '0\\xa0s\\xa0≤\\xa0τ\\xa0≤\\xa03\\xa0s']
    """
    return _TOGETHER.sub(lambda gap: gap[0].replace(" ", "\N{NO-BREAK SPACE}"), text)


def jointed(name: str) -> SafeString:
    """Let a long name break after each underscore, as HTML."""
    *parts, last = name.split("_")
    return format_html("{}{}", format_html_join("", "{}_<wbr>", ((part,) for part in parts)), last)


def joined(html: str) -> str:
    """Leave out the line breaks between the pieces of a template, which else would show as spaces.

    A space that shows is written `&#32;`. For the tag `filter`, which does not escape what it has rendered.

    >>> joined("<b\\n  class=x\\n>14.8</b>\\n  <i>best</i>\\n")
    '<b\\n  class=x\\n>14.8</b><i>best</i>'
    """
    return _LINE_BREAK.sub("", html)


def breakable(path: str) -> SafeString:
    """Let a path break after each slash, as HTML."""
    *folders, last = path.split("/")
    return format_html("{}{}", format_html_join("", "{}/<wbr>", ((part,) for part in folders)), last)


def with_whole_dates(text: str) -> SafeString:
    """Keep each date of a text on one line, as HTML whose text is the same.

    >>> with_whole_dates("on 2026-11-24.")
    'on <span class="together">2026-11-24</span>.'
    """
    return _alternating(re.split(r"(\d{4}-\d\d-\d\d)", text), '<span class="together">{}</span>')


def lined(text: str) -> SafeString:
    """Let each line of an output be indented where it continues, and keep one with columns whole, as HTML."""
    lines = ((" tabular" if _COLUMNS.search(line) else "", line) for line in text.splitlines())
    return format_html_join("", '<span class="line{}">{}\n</span>', lines)


def day(at: datetime) -> SafeString:
    """Format the day, with time and zone on hover."""
    return _time(at, "%Y-%m-%d")


def moment(at: datetime) -> SafeString:
    """Format day and minute, with seconds and zone on hover."""
    return _time(at, "%Y-%m-%d %H:%M UTC")


def second(at: datetime) -> SafeString:
    return _time(at, "%Y-%m-%d %H:%M:%S UTC")


def clock(at: datetime) -> SafeString:
    """Format the time to the second, with day and zone on hover."""
    return _time(at, "%H:%M:%S")


def _time(at: datetime, pattern: str) -> SafeString:
    at = at.astimezone(UTC)
    if at.time() == time.max:  # so a day is written whose time is nobody's business
        return format_html('<time datetime="{0}">{0}</time>', f"{at:%Y-%m-%d}")
    return format_html(
        '<time datetime="{}" title="{}">{}</time>',
        at.isoformat(timespec="seconds"),
        f"{at:%Y-%m-%d %H:%M:%S} UTC",
        f"{at:{pattern}}",
    )
