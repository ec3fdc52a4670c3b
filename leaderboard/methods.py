"""Methods: what a team's approach has achieved."""

from dataclasses import dataclass
from datetime import datetime

from django.contrib.auth.models import AnonymousUser

from leaderboard import standings
from leaderboard.models import Edition, Method, Split, Status, Submission, User
from leaderboard.standings import Entry


@dataclass(frozen=True)
class Result:
    """What a method achieved on one split: its row of the published board, and when it was tried."""

    split: Split
    edition: Edition
    entry: Entry
    n_ranked: int
    submitted_at: tuple[datetime, ...]  # its standing, scored submissions, the newest first


def results(*, method: Method, viewer: User | AnonymousUser) -> tuple[Result, ...]:
    """A result for each split on whose published board the viewer sees the method, in the splits' order."""
    found = []
    splits = Split.objects.exclude(published_edition=None)
    for split in splits.select_related("published_edition__ground_truth"):
        board = standings.board(split=split, viewer=viewer)
        entry = next((entry for entry in board.entries if entry.method_id == method.pk), None)
        if entry is None or board.edition is None:
            continue
        n_ranked = sum(other.is_visible_to_all and other.rank is not None for other in board.entries)
        dates = (
            Submission.objects.standing()
            .filter(method=method, evaluations__edition=board.edition, evaluations__status=Status.SCORED)
            .values_list("submitted_at", flat=True)
        )
        found.append(Result(split, board.edition, entry, n_ranked, tuple(dates)))
    return tuple(found)
