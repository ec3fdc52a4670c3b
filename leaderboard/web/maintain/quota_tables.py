"""Quotas in words: rules, and the slots that a team has left."""

from datetime import datetime
from typing import Any, Final

from leaderboard.models import Split, Team, User
from leaderboard.models.quotas import QuotaRules
from leaderboard.quotas import usage
from leaderboard.quotas.admissions import refusal_for_all
from leaderboard.quotas.spans import span
from leaderboard.web.formatting import grouped

_CLOSED: Final = {"split-not-open": "not open yet", "split-closed": "closed"}


def rules_of(row: QuotaRules) -> dict[str, str]:
    """Word the rules of a split or team, one by one."""
    return {
        "submissions": submissions_of(row),
        "rejected_limit": _most(row.quota_rejected_limit),
    }


def submissions_of(row: QuotaRules) -> str:
    """Word how many submissions a team has, and how far apart.

    >>> from datetime import timedelta
    >>> from leaderboard.models import Split
    >>> submissions_of(Split(quota_limit=3, quota_window=timedelta(30), quota_min_gap=timedelta(1)))
    '3 in 30 days, 24 hours apart'
    """
    limit = row.quota_limit
    most = "no limit" if limit is None else f"{grouped(limit)} in {span(row.quota_window)}"
    return f"{most}, {span(row.quota_min_gap)} apart" if row.quota_min_gap else most


def sentence_of(row: QuotaRules) -> str:
    """Word rules as part of a sentence.

    >>> from datetime import timedelta
    >>> from leaderboard.models import Split
    >>> sentence_of(Split(quota_limit=3, quota_window=timedelta(days=30), quota_rejected_limit=None))
    '3 submissions within 30 days; any number of rejected or cancelled files'
    """
    sent = turned_away = "any number of"
    within = within_a_day = ""
    if row.quota_limit is not None:
        sent, within = grouped(row.quota_limit), f" within {span(row.quota_window)}"
    if row.quota_rejected_limit is not None:
        turned_away, within_a_day = grouped(row.quota_rejected_limit), " within 24 hours"
    apart = f", at least {span(row.quota_min_gap)} apart" if row.quota_min_gap else ""
    submissions = "submission" if row.quota_limit == 1 else "submissions"
    files = "file" if row.quota_rejected_limit == 1 else "files"
    return f"{sent} {submissions}{within}{apart}; {turned_away} rejected or cancelled {files}{within_a_day}"


def team_rows(team: Team, *, viewer: User, now: datetime) -> list[dict[str, Any]]:
    """Return the team's rules and what it has left, for every split."""
    own = {row.split_id: row for row in team.quota_overrides.select_related("set_by")}
    admitted = {row.split_id: row for row in team.admissions.all()}
    return [
        {
            "split": split,
            "own": own.get(split.pk),
            "rules": rules_of(own.get(split.pk, split)),
            "quota": usage.state(team=team, user=viewer, split=split, now=now),
            "admission": admitted.get(split.pk),
            "closed": _CLOSED[refusal.code] if (refusal := refusal_for_all(split, now=now)) else "",
        }
        for split in Split.objects.all()
    ]


def _most(count: int | None) -> str:
    return "no limit" if count is None else grouped(count)
