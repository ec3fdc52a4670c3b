"""How times, counts and sizes are written on every page."""

from datetime import UTC, datetime

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from evaluator import format_rounded
from evaluator.counting import counted


def grouped(value: int | None) -> str:
    """A count with its thousands set apart.

    >>> grouped(28600)
    '28,600'
    """
    return "" if value is None else f"{value:,}"


def with_noun(value: int, nouns: str) -> str:
    """A count and its noun; two nouns with a comma between them where an s does not make the plural.

    >>> with_noun(1, "recording"), with_noun(3, "person,people")
    ('1 recording', '3 people')
    """
    return counted(value, *nouns.split(","))


def signed(value: float, *, decimals: int = 2) -> str:
    """A difference with its sign, and a minus that is one.

    >>> signed(-4.1), signed(0.204), signed(-0.001), signed(-4.1, decimals=1)
    ('−4.10', '+0.20', '0.00', '−4.1')
    """
    text = format_rounded(abs(value), decimals=decimals)
    if not float(text):
        return text
    return f"{'−' if value < 0 else '+'}{text}"


def size(n_bytes: int) -> str:
    """A size in the largest fitting unit.

    >>> size(812), size(81_234), size(20_000_000)
    ('812 bytes', '81.2 KB', '20 MB')
    """
    if n_bytes < 1000:
        return counted(n_bytes, "byte")
    return f"{n_bytes / 1e3:.3g} KB" if n_bytes < 1e6 else f"{n_bytes / 1e6:.3g} MB"


def duration(seconds: float | None) -> str:
    """A span of time, as exactly as an estimate deserves.

    >>> duration(0.3), duration(41.8), duration(150), duration(9000)
    ('1 s', '42 s', '3 min', '3 h')
    """
    if seconds is None:
        return ""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{-(-seconds // 60):.0f} min" if seconds < 5400 else f"{-(-seconds // 3600):.0f} h"


def ticked(text: str) -> SafeString:
    """A sentence in which `names` are set in backticks, as HTML.

    >>> ticked("The envelope has no `predictions`.")
    'The envelope has no <code>predictions</code>.'
    """
    parts = text.split("`")
    pieces = (part if i % 2 == 0 else format_html("<code>{}</code>", part) for i, part in enumerate(parts))
    return format_html_join("", "{}", ((piece,) for piece in pieces))


def breakable(path: str) -> SafeString:
    """A path that may go on in the next line after each of its slashes, as HTML.

    >>> breakable("/api/v1")
    '/<wbr>api/<wbr>v1'
    """
    *folders, last = path.split("/")
    return format_html("{}{}", format_html_join("", "{}/<wbr>", ((part,) for part in folders)), last)


def day(at: datetime) -> SafeString:
    """The day, with time and zone on hover."""
    return _time(at, "%Y-%m-%d")


def moment(at: datetime) -> SafeString:
    """Day and minute, with seconds and zone on hover."""
    return _time(at, "%Y-%m-%d %H:%M UTC")


def second(at: datetime) -> SafeString:
    """Day, second and zone."""
    return _time(at, "%Y-%m-%d %H:%M:%S UTC")


def clock(at: datetime) -> SafeString:
    """The time of day to the second, with day and zone on hover."""
    return _time(at, "%H:%M:%S")


def _time(at: datetime, pattern: str) -> SafeString:
    at = at.astimezone(UTC)
    return format_html(
        '<time datetime="{}" title="{}">{}</time>',
        at.isoformat(timespec="seconds"),
        f"{at:%Y-%m-%d %H:%M:%S} UTC",
        f"{at:{pattern}}",
    )
