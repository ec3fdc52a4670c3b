"""Tables of editions: changes in words, and progress of re-scoring."""

from collections.abc import Sequence
from typing import Any

from evaluator.counting import counted
from evaluator.metrics.protocol import primary_value
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import flat_scores
from leaderboard.editions import history
from leaderboard.editions.corrections import RescoringProgress
from leaderboard.models import Edition, Evaluation, GroundTruth, Publication, Split, Status
from leaderboard.web.boards import tables
from leaderboard.web.formatting import duration, grouped


def truth_words(change: history.TruthChange | None) -> str:
    """Word the difference of two ground truths; empty for none.

    >>> truth_words(history.TruthChange(n_added=3, n_removed=0, n_changed=12, n_renumbered=0))
    '12 labels corrected, 3 sequences added'
    >>> truth_words(history.TruthChange(0, 1, 0, 7)), truth_words(None)
    ('1 sequence removed, 7 sequences renumbered', 'different ground truth')
    """
    if change is None:
        return "different ground truth"
    parts = (
        (change.n_changed, "label", "corrected"),
        (change.n_added, "sequence", "added"),
        (change.n_removed, "sequence", "removed"),
        (change.n_renumbered, "sequence", "renumbered"),
    )
    return ", ".join(f"{counted(n, noun)} {done}" for n, noun, done in parts if n)


def truth_choices(split: Split, truths: Sequence[GroundTruth]) -> tuple[tuple[GroundTruth, str], ...]:
    """Return ground truths with their difference from the board's, in words; "" for the board's own."""
    board = split.current_edition.ground_truth if split.current_edition else None
    changes = (history.change_of_truth(board, truth) if board else None for truth in truths)
    words = (truth_words(change) if change else "not compared" for change in changes)
    return tuple(zip(truths, words, strict=True))


def change_words(old: Edition, new: Edition) -> str:
    return _change_words(history.change_of_truth(old.ground_truth, new.ground_truth), old, new)


def _change_words(change: history.TruthChange | None, old: Edition, new: Edition) -> str:
    truth = truth_words(change)
    rules = f"protocol {new.protocol} instead of {old.protocol}" if old.protocol != new.protocol else ""
    return ", ".join(part for part in (truth, rules) if part)


def news(split: Split) -> str:
    """Word the last change to the current edition of a board; empty for its first."""
    publication = history.latest_change(split)
    if publication is None or publication.replaced is None:
        return ""
    if publication.kind == Publication.Kind.ROLLED_BACK:
        return "rolled back"
    return change_words(publication.replaced, publication.edition)


def past_change(past: history.EditionRecord) -> str:
    return _change_words(past.change, past.followed, past.edition) if past.followed else "first edition"


def rescored_notice(rescored: history.Rescored | None) -> dict[str, Any] | None:
    """Return the effect of the board's last change on a submission."""
    if rescored is None:
        return None
    old, new, publication = rescored.old, rescored.new, rescored.publication
    former = publication.replaced
    if former is None:
        return None
    if old and new and old.status == new.status == Status.REJECTED:
        return None
    if publication.kind == Publication.Kind.ROLLED_BACK:
        heading = f"Rolled back to edition {publication.edition.number} on"
    elif new and new.status == Status.SCORED:
        heading = f"Re-scored in edition {publication.edition.number} on"
    else:
        heading = f"Edition {publication.edition.number} was published on"
    return {
        "publication": publication,
        "heading": heading,
        "outcome": _outcome(old, new, former.number),
    }


def _outcome(old: Evaluation | None, new: Evaluation | None, former: int) -> str:
    before, after = _value_text(old), _value_text(new)
    if new and new.status == Status.SCORED:
        symbol = new.edition.rules.primary.symbol
        if old and old.edition.rules.primary != new.edition.rules.primary:
            return f"{old.edition.rules.primary.symbol} {before} → {symbol} {after}."
        return f"{symbol} stays {after}." if before == after else f"{symbol} {before} → {after}."
    kept = ""
    if old and before != tables.ABSENT:
        kept = f" Its result in edition {former} stays: {old.edition.rules.primary.symbol} {before}."
    if new is None or new.status == Status.CANCELLED:
        return f"The new edition leaves this file out.{kept}"
    if new.status == Status.REJECTED:
        return f"The new edition cannot score this file; see the reason below.{kept}"
    if new.status == Status.SYSTEM_ERROR:
        return f"Re-scoring this file failed because of a system error.{kept}"
    return f"This file is waiting to be re-scored.{kept}"


def _value_text(evaluation: Evaluation | None) -> str:
    """The score that ranks."""
    if evaluation is None:
        return tables.ABSENT
    return format_rounded(primary_value(flat_scores(evaluation)), decimals=evaluation.edition.decimals)


def running(edition: Edition, progress: RescoringProgress) -> dict[str, Any]:
    """Return the progress of a re-scoring; a waiting page sends `seen` to ask for news."""
    ends = (
        (progress.n_scored, "scored"),
        (progress.n_rejected, "rejected"),
        (progress.n_failed, "with a system error"),
        (progress.n_cancelled, "cancelled"),
    )
    pace = ""
    if progress.rate_per_s is not None:
        pace = f"{rate_words(progress.rate_per_s)}, about {duration(progress.left_s)} left"
    counts = ", ".join(f"{grouped(n)} {end}" for n, end in ends if n)
    return {
        "edition": edition,
        "progress": progress,
        "words": _progress_words(edition, progress, counts=counts),
        "pace": pace,
        "is_final": progress.n_waiting == 0,
        "seen": f"{progress.n_done}-{progress.n_total}",
    }


def _progress_words(edition: Edition, progress: RescoringProgress, *, counts: str) -> str:
    """Word how far a re-scoring is; `counts` are its ends in words."""
    if not progress.n_total:
        return f"{edition.split.title} has no submissions to score."
    submissions = counted(progress.n_total, "submission")
    if not progress.n_waiting:
        return f"Finished. {submissions}: {counts}." if counts else f"Finished. {submissions}."
    words = f"{progress.percent}%. {grouped(progress.n_done)} of {submissions} finished"
    if not counts:
        return f"{words}."
    # The pace, which stands beside it, tells more.
    waiting = f"; {grouped(progress.n_waiting)} waiting or running" if progress.rate_per_s is None else ""
    return f"{words}: {counts}{waiting}."


def rate_words(rate_per_s: float) -> str:
    """Word a rate in the unit in which it is more than one.

    >>> rate_words(41.7), rate_words(0.25)
    ('41.7 per second', '15 per minute')
    """
    return f"{rate_per_s:.1f} per second" if rate_per_s >= 1 else f"{60 * rate_per_s:.0f} per minute"
