"""What came of a submission as its page places it: numbers, rank, what is beside it, a row for a paper."""

from dataclasses import dataclass
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.report import format_published
from leaderboard import exports, outcomes
from leaderboard.entries import Entry
from leaderboard.models import Submission, Visibility
from leaderboard.outcomes import Place
from leaderboard.quotas import Quota
from leaderboard.submissions import Progress
from leaderboard.web.compare_tables import signed
from leaderboard.web.result_tables import ResultGroup, result_groups
from leaderboard.web.tables import rank_range


@dataclass(frozen=True)
class BesideRow:
    """One row to compare with. The differences are this submission minus the row: below 0 it is better."""

    label: str
    href: str
    about: str
    mid: str
    mid_gap: str
    rte: str
    rte_gap: str
    css: str = ""  # how many decimals its values have, where fewer than usual
    source: str = ""  # of a row printed in a paper
    compare_href: str = ""  # to what the differences mean, where recordings can be compared


@dataclass(frozen=True)
class OutcomeTable:
    """Everything that the template places of a scored submission."""

    groups: tuple[ResultGroup, ...]
    interval_note: str
    entry: Entry
    place: Place | None
    rank_range: str
    beside: tuple[BesideRow, ...]
    latex: str


def outcome_table(
    submission: Submission, progress: Progress, *, place: Place | None, interval_note: str, is_mine: bool
) -> OutcomeTable | None:
    """A scored submission, ready to be placed; None for any other. `is_mine`: the reader's team's."""
    if progress.scores is None:
        return None
    entry = Entry(
        kind="submission",
        method=submission.method.name,
        team=submission.method.team.name,
        scores=progress.scores,
        decimals=progress.decimals,
        intervals=outcomes.shown_intervals(progress, place),
        method_id=submission.method_id,
        submission_id=submission.pk,
        visibility=submission.method.visibility,
        pseudonym=submission.method.pseudonym if submission.method.visibility == Visibility.ANONYMOUS else "",
        rank=place.rank if place else None,
        best=place.best if place else frozenset(),
        second=place.second if place else frozenset(),
    )
    return OutcomeTable(
        groups=result_groups(
            progress.scores,
            progress.counts,
            intervals=entry.intervals,
            decimals=entry.decimals,
            best=entry.best,
            second=entry.second,
        ),
        interval_note=interval_note,
        entry=entry,
        place=place,
        rank_range=rank_range(entry),
        beside=_beside(submission, progress, place, entry, is_mine=is_mine) if place else (),
        latex=exports.latex_row(entry),
    )


def _beside(
    submission: Submission, progress: Progress, place: Place, entry: Entry, *, is_mine: bool
) -> tuple[BesideRow, ...]:
    """The team's best other submission and the nearest row from a paper, where there are."""
    rows = []
    own = outcomes.teams_best_other(submission, place)
    if own is not None:
        whose = "your" if is_mine else "its"
        rows.append(
            _beside_row(
                entry,
                own,
                href=reverse("submission", args=[own.submission_id]),
                about=f"{whose} team’s best other, {own.date_text}",
                compare_href=_compare_href(submission, place, own) if is_mine else "",
            )
        )
    printed = outcomes.nearest_published(progress, place)
    if printed is not None:
        about = f"nearest published, {exports.short_authors(printed.team)} {printed.date_text}"
        rows.append(_beside_row(entry, printed, href=printed.paper_url, about=about))
    return tuple(rows)


def _beside_row(entry: Entry, other: Entry, *, href: str, about: str, compare_href: str = "") -> BesideRow:
    return BesideRow(
        label=other.method,
        href=href,
        about=about,
        mid=format_published(other.scores["mid"], decimals=other.decimals),
        mid_gap=_gap(entry, other, "mid"),
        rte=format_published(other.scores["rte"], decimals=other.decimals),
        rte_gap=_gap(entry, other, "rte"),
        css="" if other.decimals >= entry.decimals else f" d{other.decimals}",
        source=other.source,
        compare_href=compare_href,
    )


def _gap(entry: Entry, other: Entry, name: str) -> str:
    mine, theirs = entry.scores[name], other.scores[name]
    return (
        ""
        if mine is None or theirs is None
        else signed(mine - theirs, decimals=max(entry.decimals, other.decimals))
    )


def _compare_href(submission: Submission, place: Place, other: Entry) -> str:
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
    >>> from leaderboard.quotas import Rules
    >>> rules = Rules(limit=3, window=timedelta(days=30), min_gap=timedelta(0), rejected_limit=20)
    >>> rejected_sentence(Quota("test", rules, 0, 3, True, None, ""))[31:]
    'Of 20 rejected or cancelled files that are taken in 24 hours, 17 are left.'
    """
    if quota is None:
        return ""
    costs = "It costs no slot of the quota."
    limit = quota.rules.rejected_limit
    if limit is None:
        return costs
    n_left = max(0, limit - quota.n_rejected)
    left = "1 is left" if n_left == 1 else f"{n_left or 'none'} are left"
    return f"{costs} Of {limit} rejected or cancelled files that are taken in 24 hours, {left}."
