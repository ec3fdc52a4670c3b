"""When a split takes submissions, in the words of pages, API and command line."""

from dataclasses import replace
from datetime import datetime

from leaderboard.errors.refusals import Refused
from leaderboard.models import Split, Team, User
from leaderboard.quotas import admissions, quotas


def refusal_of(split: Split, *, now: datetime) -> Refused | None:
    """Why a split takes nothing from anybody now; None if it does."""
    code, sentence = "", ""
    opens_at, closes_at = split.times
    if split.is_archived:
        code, sentence = "split-closed", "are closed: the split is archived."
    elif not split.has_ground_truth:
        code, sentence = (
            "split-not-open",
            "are not open yet: this site does not have the ground truth of the split.",
        )
    elif opens_at and now < opens_at:
        code, sentence = "split-not-open", f"open at {opens_at:%Y-%m-%d %H:%M} UTC."
    elif closes_at and now >= closes_at:
        code, sentence = "split-closed", f"closed at {closes_at:%Y-%m-%d %H:%M} UTC."
    return Refused(code, f"Submissions to {split.pk} {sentence}", field="split") if code else None


def is_open(split: Split, *, now: datetime) -> bool:
    """Whether the split takes submissions, from whoever has a slot left."""
    return refusal_of(split, now=now) is None


def sentence_of(split: Split, *, now: datetime) -> str:
    """Since when, until when or why not the split takes submissions; empty where nothing limits it."""
    return str(refusal_of(split, now=now) or closing_of(split))


def closing_of(split: Split) -> str:
    """Until when a split that takes submissions does so; empty where nothing limits it."""
    closes_at = split.times[1]
    return f"Submissions to {split.pk} close at {closes_at:%Y-%m-%d %H:%M} UTC." if closes_at else ""


def left(*, team: Team | None, user: User, split: Split, now: datetime) -> quotas.Quota:
    """What the team has left on the split; none of it can be had while the split takes nothing from it."""
    quota = quotas.state(team=team, user=user, split=split, now=now)
    refusal = refusal_of(split, now=now)
    not_admitted = admissions.refusal_of(team=team, split=split)
    if refusal is None and not_admitted is not None:
        return replace(quota, is_open=False, next_slot_at=None, sentence=str(not_admitted))
    if refusal is None:
        return quota
    opens_at = split.times[0]
    is_to_come = opens_at is not None and opens_at > now and split.has_ground_truth
    return replace(quota, is_open=False, next_slot_at=opens_at if is_to_come else None, sentence=str(refusal))
