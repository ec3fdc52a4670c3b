"""Rules of quotas: those of a split, of a team that has others, and what holds where one makes no sense.

Forms, models and the database refuse a rule that makes no sense. One that got into the database all the same
must not stop submissions: it is reported, and another one holds instead of it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from functools import lru_cache
from typing import Any

import structlog
from django.conf import settings

from leaderboard.benchmark import splits
from leaderboard.models import QuotaOverride, Split, Team
from leaderboard.models.quotas import QuotaRules

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class Rules:
    """What holds for a team on a split; None is without limit."""

    limit: int | None
    window: timedelta
    min_gap: timedelta
    rejected_limit: int | None

    @property
    def window_s(self) -> float:
        """The window in seconds."""
        return self.window.total_seconds()

    @property
    def min_gap_s(self) -> float:
        """The gap in seconds."""
        return self.min_gap.total_seconds()


REJECTED_WINDOW = timedelta(hours=24)
BYTES_WINDOW = timedelta(hours=24)
UNLIMITED = Rules(limit=None, window=timedelta(days=1), min_gap=timedelta(0), rejected_limit=None)


def rules_of(*, team: Team | None, split: Split) -> Rules:
    """The split's rules, or the team's own.

    Instead of a rule that makes no sense the next one holds: the split's own, then the one that the split
    had from the start.
    """
    if not settings.QUOTAS:
        return UNLIMITED
    own = QuotaOverride.objects.filter(team=team, split=split).first() if team else None
    rows: list[QuotaRules] = [row for row in (own, split, _shipped(split)) if row is not None]
    return Rules(**{name.removeprefix("quota_"): _first_sound(rows, name) for name in _NAMES})


_NAMES = ("quota_limit", "quota_window", "quota_min_gap", "quota_rejected_limit")


def _first_sound(rows: list[QuotaRules], name: str) -> Any:
    """The rule of the first row in which it makes sense; the last row has no faults."""
    for row in rows:
        fault = row.faults().get(name)
        if fault is None:
            break
        _report(str(row), fault)
    return getattr(row, name)


def _shipped(split: Split) -> QuotaRules:
    """The rules that the split had from the start; of another split those of a new one."""
    fields = next((fields for fields in splits.SPLITS if fields["name"] == split.pk), {})
    return Split(**{name: fields[name] for name in _NAMES if name in fields})


@lru_cache(maxsize=256)
def _report(where: str, fault: str) -> None:
    # Once in a process: it is found again with every request.
    log.error("quota_rule_ignored", where=where, fault=fault)


_UNTIL = "This is ignored until you correct it."


def ignored() -> tuple[str, ...]:
    """What in the database makes no sense and is ignored, each in a sentence for maintainers."""
    return tuple(_ignored())


def _ignored() -> Iterator[str]:
    for split in Split.objects.all():
        for fault in split.faults().values():
            yield f"The rules of {split.pk}: {fault} {_UNTIL}"
    for row in QuotaOverride.objects.select_related("team"):
        for fault in row.faults().values():
            yield f"The rules of {row.team.name} on {row.split_id}: {fault} {_UNTIL}"
