"""Tables of a submission's page: numbers, rank, comparison with others, a row for a paper."""

from collections.abc import Iterable
from typing import Any
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.counting import counted
from evaluator.metrics.protocol import grouped_names, split_name
from evaluator.scoring.report import format_published
from leaderboard.boards.rows import Entry
from leaderboard.exports import tables
from leaderboard.models import Submission, Visibility
from leaderboard.quotas.quotas import Quota
from leaderboard.submissions import outcomes
from leaderboard.submissions.outcomes import BoardPlace
from leaderboard.submissions.submissions import Progress
from leaderboard.web.boards.compare_tables import signed
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.methods.result_tables import result_groups


def outcome_table(
    submission: Submission, progress: Progress, *, place: BoardPlace | None, interval_note: str, is_mine: bool
) -> dict[str, Any] | None:
    """A scored submission, ready to be placed; None for any other. `is_mine`: the reader's team's."""
    if progress.scores is None:
        return None
    entry = Entry(
        kind="submission",
        method=submission.method.name,
        team=submission.method.team.name,
        scores=progress.scores,
        decimals=progress.decimals,
        intervals=outcomes.published_intervals(progress, place),
        method_id=submission.method_id,
        submission_id=submission.pk,
        visibility=submission.method.visibility,
        pseudonym=submission.method.pseudonym if submission.method.visibility == Visibility.ANONYMOUS else "",
        rank=place.rank if place else None,
        best=place.best if place else frozenset(),
        second=place.second if place else frozenset(),
    )
    return {
        "groups": result_groups(entry, progress.counts),
        "interval_note": interval_note,
        "place": place,
        "rank_range": rank_range(entry),
        "errors": tuple(grouped_names(progress.scores)),
        "beside": _comparison_rows(submission, progress, place, entry, is_mine=is_mine) if place else [],
        "latex": tables.latex_row(entry),
        "latex_order": _order_words(progress.scores),
    }


def _order_words(names: Iterable[str]) -> str:
    """The order of these scores.

    >>> _order_words(["mid", "mid_small", "rte", "rte_small"])
    'MiD and RTE (each overall, small)'
    """
    groups = grouped_names(names)
    symbols, columns = [metric.symbol for metric in groups], next(iter(groups.values()))
    ranges = ", ".join(split_name(name)[1] for name in columns)
    return f"{', '.join(symbols[:-1])} and {symbols[-1]} (each {ranges})"


def _comparison_rows(
    submission: Submission, progress: Progress, place: BoardPlace, entry: Entry, *, is_mine: bool
) -> list[dict[str, Any]]:
    """The team's best other submission and the nearest row from a paper, where there are."""
    rows = []
    own = outcomes.teams_best_other(submission, place)
    if own is not None:
        whose = "your" if is_mine else "its"
        rows.append(
            _comparison_row(
                entry,
                own,
                href=reverse("submission", args=[own.submission_id]),
                about=f"{whose} team’s best other method, {own.date_text}",
                compare_href=_compare_href(submission, place, own) if is_mine else "",
            )
        )
    printed = outcomes.nearest_published(progress, place)
    if printed is not None:
        about = f"nearest row from a paper, {tables.team_of(printed)} {printed.date_text}"
        rows.append(_comparison_row(entry, printed, href=printed.paper_url, about=about))
    return rows


def _comparison_row(
    entry: Entry, other: Entry, *, href: str, about: str, compare_href: str = ""
) -> dict[str, Any]:
    """One row to compare with. Differences are this submission minus the row: below 0 it is better."""
    return {
        "label": other.method,
        "href": href,
        "about": about,
        "errors": [
            (format_published(other.scores[name], decimals=other.decimals), _gap(entry, other, name))
            for name, *_ in grouped_names(entry.scores).values()
        ],
        "css": "" if other.decimals >= entry.decimals else f" d{other.decimals}",
        "compare_href": compare_href,  # to what the differences mean, where recordings can be compared
    }


def _gap(entry: Entry, other: Entry, name: str) -> str:
    mine, theirs = entry.scores[name], other.scores[name]
    return (
        ""
        if mine is None or theirs is None
        else signed(mine - theirs, decimals=max(entry.decimals, other.decimals))
    )


def _compare_href(submission: Submission, place: BoardPlace, other: Entry) -> str:
    """To the comparison of both methods; empty unless each is represented on the board by this submission.

    Empty as well where nothing is told of two methods of one team.
    """
    if place.rank is None or other.method_id == submission.method_id or submission.split.is_hidden:
        return ""
    query = urlencode([("split", submission.split_id), ("m", submission.method_id), ("m", other.method_id)])
    return f"{reverse('compare')}?{query}"


def rejected_sentence(quota: Quota | None) -> str:
    """What a rejected file costs, and how many more are taken; `quota` None: it is no question of that.

    >>> from datetime import timedelta
    >>> from leaderboard.quotas.quotas import Rules
    >>> rules = Rules(limit=3, window=timedelta(days=30), min_gap=timedelta(0), rejected_limit=20)
    >>> rejected_sentence(Quota("test", rules, 0, 3, True, None, ""))
    'Your quota is not used. Up to 20 files may be rejected within 24 hours; 17 are left.'
    """
    if quota is None:
        return ""
    limit = quota.rules.rejected_limit
    if limit is None:
        return "Your quota is not used."
    n_left = max(0, limit - quota.n_rejected)
    return (
        f"Your quota is not used. Up to {counted(limit, 'file')} may be rejected within 24 hours; "
        f"{counted(n_left, 'is', 'are')} left."
    )
