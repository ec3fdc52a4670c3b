"""Moments as maintainers write them: a date, a time and always a zone."""

import re
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import Final
from zoneinfo import ZoneInfo

from leaderboard.errors.refusals import Refused

EXAMPLE: Final = "2027-03-01 23:59 UTC"
# "Anywhere on Earth": a day is over when it is over everywhere. Deadlines of conferences are given in it.
_ANYWHERE: Final = timezone(timedelta(hours=-12), "AoE")
_FORM: Final = re.compile(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d)(?::00)?\s*(\S.*)?", re.ASCII)
_OFFSET: Final = re.compile(r"([+-])(\d\d):?(\d\d)", re.ASCII)
_ZONES: Final = "UTC, AoE, a place like Europe/Berlin, or an offset like +01:00"


def parse(text: str, *, field: str = "") -> datetime:
    """Parse a text like `2027-03-01 23:59 Europe/Berlin` into UTC. Raises `Refused`.

    A time must have a zone, and must not be one that the zone's clocks skip or show twice.
    """
    text = text.strip()
    match = _FORM.fullmatch(text)
    if match is None:
        raise _refused(f"{text[:60]!r} is not a date with a time", f"one like {EXAMPLE}", field)
    if not match[3]:
        raise _refused(f"{text[:60]!r} has no time zone", f"{_ZONES} after the time", field)
    try:
        local = datetime.fromisoformat(f"{match[1]} {match[2]}")
    except ValueError:
        raise _refused(
            f"{match[1]} {match[2]} is not in the calendar", f"one like {EXAMPLE}", field
        ) from None
    zone = _zone(match[3], field)
    try:
        moments = {local.replace(tzinfo=zone, fold=fold).astimezone(UTC) for fold in (0, 1)}
        there = {moment for moment in moments if moment.astimezone(zone).replace(tzinfo=None) == local}
    except OverflowError:
        raise _refused(f"{text[:60]!r} is outside of the calendar", f"one like {EXAMPLE}", field) from None
    if len(there) != 1:
        how = "occurs twice" if there else "does not occur"
        what = f"The time {match[1]} {match[2]} {how} in {match[3]}, because the clocks change then"
        raise _refused(what, "an offset like +01:00, or UTC", field)
    return there.pop()


def formatted(moment: datetime | None) -> str:
    """Format a moment as `parse` reads it; empty without one."""
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC" if moment else ""


def _zone(name: str, field: str) -> tzinfo:
    if name.upper() in {"UTC", "Z"}:
        return UTC
    if name.lower() == "aoe":
        return _ANYWHERE
    offset = _OFFSET.fullmatch(name)
    if offset and int(offset[2]) <= 14 and int(offset[3]) < 60:
        ahead = timedelta(hours=int(offset[2]), minutes=int(offset[3]))
        return timezone(ahead if offset[1] == "+" else -ahead)
    # A place, and no abbreviation: CST is in three parts of the world.
    if "/" in name:
        try:
            return ZoneInfo(name)
        except (ValueError, OSError, LookupError):
            pass  # a path, a folder, or a place that is not there
    raise _refused(f"There is no time zone {name[:40]!r}", _ZONES, field)


def _refused(fault: str, expected: str, field: str) -> Refused:
    return Refused("bad-value", f"{fault}; expected {expected}.", field=field)
