"""Tables of a submission's page: numbers, rank, comparison, a row for a paper."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any
from urllib.parse import urlencode

from django.urls import reverse
from django.utils.text import get_text_list

from evaluator.counting import counted
from evaluator.metrics.protocol import grouped_names, split_name
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import Entry
from leaderboard.exports import tables
from leaderboard.models import Submission, Visibility
from leaderboard.quotas.usage import Quota
from leaderboard.submissions import outcomes
from leaderboard.submissions.outcomes import BoardPosition
from leaderboard.submissions.progress import Progress
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.formatting import signed
from leaderboard.web.methods.result_tables import result_table
from leaderboard.web.methods.score_cards import citation, gap_to_best, score_card


def outcome_table(
    submission: Submission,
    progress: Progress,
    *,
    board_position: BoardPosition | None,
    interval_note: str,
    is_mine: bool,
) -> dict[str, Any] | None:
    """Return the tables of a scored submission; `is_mine`: of the reader's team."""
    if progress.scores is None:
        return None
    entry = Entry(
        kind="submission",
        method=submission.method.name,
        team=submission.method.team.name,
        scores=progress.scores,
        decimals=progress.decimals,
        intervals=outcomes.published_intervals(progress, board_position),
        method_id=submission.method_id,
        submission_id=submission.pk,
        date=submission.submitted_at,
        visibility=submission.method.visibility,
        pseudonym=submission.method.pseudonym if submission.method.visibility == Visibility.ANONYMOUS else "",
        rank=board_position.rank if board_position else None,
        best=board_position.best if board_position else frozenset(),
        second=board_position.second if board_position else frozenset(),
    )
    rows = board_position.rows if board_position else ()
    n_ranked = board_position.n_ranked if board_position else 0
    card = score_card(entry, rows, n_ranked=n_ranked, gap=gap_to_best(entry, rows))
    # A private method has no rank that others could look up.
    quoted = replace(entry, rank=None) if board_position and board_position.is_supposed else entry
    return {
        "table": result_table(entry, progress.counts),
        "card": card,
        "citation": citation(
            card._replace(entry=quoted), split=submission.split.title, edition=progress.edition_number
        )
        if card
        else "",
        "interval_note": interval_note,
        "board_position": board_position,
        "rank_range": rank_range(entry),
        "errors": tuple(grouped_names(progress.scores)),
        "beside": _comparison_rows(submission, progress, board_position, entry, is_mine=is_mine)
        if board_position
        else [],
        "latex": tables.latex_row(quoted),
        "latex_with_intervals": tables.latex_row(quoted, has_intervals=True) if entry.intervals else "",
        "latex_order": _order_words(progress.scores),
    }


def _order_words(names: Iterable[str]) -> str:
    """Word the order of these scores.

    >>> _order_words(["mid", "mid_small", "rte", "rte_small"])
    'MiD and RTE (each overall, small)'
    """
    groups = grouped_names(names)
    symbols, columns = [metric.symbol for metric in groups], next(iter(groups.values()))
    ranges = ", ".join(split_name(name)[1] for name in columns)
    return f"{get_text_list(symbols, 'and')} ({'each ' if len(symbols) > 1 else ''}{ranges})"


def _comparison_rows(
    submission: Submission, progress: Progress, board_position: BoardPosition, entry: Entry, *, is_mine: bool
) -> list[dict[str, Any]]:
    rows = []
    previous = outcomes.previous_of_method(submission, board_position)
    if previous is not None:
        rows.append(
            _comparison_row(entry, previous)
            | {
                "href": reverse("submission", args=[previous.submission_id]),
                "about": "its previous submission,",
                "date": previous.date_text,
            }
        )
    own = outcomes.teams_best_other(submission, board_position)
    if own is not None and (previous is None or own.submission_id != previous.submission_id):
        # Where values are hidden, two methods of one team are never compared.
        is_compared = is_mine and board_position.rank is not None and not submission.split.is_hidden
        query = [("split", submission.split_id), ("m", submission.method_id), ("m", own.method_id)]
        rows.append(
            _comparison_row(entry, own)
            | {
                "href": reverse("submission", args=[own.submission_id]),
                "about": f"{'your' if is_mine else 'its'} team’s best other submission,",
                "date": own.date_text,
                "compare_href": f"{reverse('compare')}?{urlencode(query)}"
                if is_compared and own.method_id != submission.method_id
                else "",
            }
        )
    printed = outcomes.nearest_published(progress, board_position)
    if printed is not None:
        about = f"nearest row from a paper, {tables.team_of(printed)}"
        rows.append(
            _comparison_row(entry, printed)
            | {"href": printed.paper_url, "about": about, "date": printed.date_text}
        )
    return rows


def _comparison_row(entry: Entry, other: Entry) -> dict[str, Any]:
    # Differences are this submission minus the row: below 0 it is better.
    decimals, errors = max(entry.decimals, other.decimals), []
    for metric, (name, *_) in grouped_names(entry.scores).items():
        mine, theirs = entry.scores[name], other.scores[name]
        gap = "" if mine is None or theirs is None else signed(mine - theirs, decimals=decimals)
        errors.append((metric, format_rounded(theirs, decimals=other.decimals), gap))
    css = "" if other.decimals >= entry.decimals else f" d{other.decimals}"
    return {"label": other.method, "errors": errors, "css": css}


def rejected_sentence(quota: Quota | None) -> str:
    """Word the cost of a rejected file, and how many more are accepted.

    >>> from leaderboard.models import QuotaOverride
    >>> rejected_sentence(Quota("test", QuotaOverride(quota_rejected_limit=20), 0, 3, True, None, ""))[63:]
    '17 more rejected files are allowed in the next 24 hours.'
    """
    if quota is None:
        return "This file was not scored."
    cost = "This file was not scored and did not count against your quota."
    limit = quota.rules.quota_rejected_limit
    if limit is None:
        return cost
    n_left = max(0, limit - quota.n_rejected)
    more = counted(n_left, "more rejected file")
    return f"{cost} {more} {'is' if n_left == 1 else 'are'} allowed in the next 24 hours."
