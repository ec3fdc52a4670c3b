"""Editions as they are drawn: what changed in words, how far a re-scoring is, and what it would change."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from evaluator.protocol import SCORE_NAMES
from evaluator.report import format_published
from leaderboard import editions
from leaderboard.models import Edition, Evaluation, GroundTruth, Publication, Split, Status
from leaderboard.preview import ABSENT, Change, Preview
from leaderboard.rescoring import Progress
from leaderboard.standings import Board, flat_scores
from leaderboard.templatetags.board import duration, grouped
from leaderboard.web.tables import ABSENT as NO_VALUE
from leaderboard.web.tables import BoardTable, Heading, score_heading

_WHY_UNSCORABLE: Final = {
    "missing-keys": "Edition {} added sequences that its file does not predict.",
    "unknown-keys": "Edition {} removed sequences that its file predicts.",
    "undefined-error": "Edition {} has a protocol for which its file predicts too close to 0.",
}
_ENDED_BADLY: Final = (Status.REJECTED, Status.SYSTEM_ERROR, Status.CANCELLED)
_STATUS_LABELS: Final = {**dict(Status.choices), ABSENT: "not evaluated"}


def counted(n: int, singular: str, plural: str = "") -> str:
    """A count and its noun.

    >>> counted(1, "label"), counted(12, "label"), counted(2000, "entry", "entries")
    ('1 label', '12 labels', '2,000 entries')
    """
    return f"{grouped(n)} {singular if n == 1 else plural or singular + 's'}"


def truth_words(change: editions.TruthChange | None) -> str:
    """What differs between two ground truths, in words; empty if nothing does.

    >>> truth_words(editions.TruthChange(n_added=3, n_removed=0, n_changed=12, n_renumbered=0))
    '12 labels corrected, 3 sequences added'
    >>> truth_words(editions.TruthChange(0, 1, 0, 7)), truth_words(None)
    ('1 sequence removed, 7 sequences renumbered', 'another ground truth')
    """
    if change is None:
        return "another ground truth"
    parts = (
        (change.n_changed, "label", "corrected"),
        (change.n_added, "sequence", "added"),
        (change.n_removed, "sequence", "removed"),
        (change.n_renumbered, "sequence", "renumbered"),
    )
    return ", ".join(f"{counted(n, noun)} {done}" for n, noun, done in parts if n)


def truth_choices(split: Split, truths: Sequence[GroundTruth]) -> tuple[tuple[GroundTruth, str], ...]:
    """Ground truths, each with what differs from the board's, in words; "" for the board's own."""
    board = split.published_edition.ground_truth if split.published_edition else None
    changes = (editions.change_of_truth(board, truth) if board else None for truth in truths)
    words = (truth_words(change) if change else "not compared" for change in changes)
    return tuple(zip(truths, words, strict=True))


def change_words(old: Edition, new: Edition) -> str:
    """How one edition differs from another: in its labels, its sequences, its protocol."""
    return _change_words(editions.truth_change(old, new), old, new)


def _change_words(change: editions.TruthChange | None, old: Edition, new: Edition) -> str:
    truth = truth_words(change)
    rules = f"protocol {new.protocol} instead of {old.protocol}" if old.protocol != new.protocol else ""
    return ", ".join(part for part in (truth, rules) if part)


def news(split: Split) -> str:
    """What last changed on a board, for its head; empty while it has its first edition."""
    publication = editions.latest_change(split)
    if publication is None or publication.replaced is None:
        return ""
    if publication.kind == Publication.Kind.ROLLED_BACK:
        return f"back to edition {publication.edition.number}"
    words = change_words(publication.replaced, publication.edition)
    return f"edition {publication.edition.number}, {words}"


def with_reasons(table: BoardTable, board: Board) -> BoardTable:
    """A former board whose rows say why the present edition cannot score them, where that is so."""
    present = board.split.published_edition
    if present is None or not any(row.entry.is_unscorable for row in table.rows):
        return table
    rows = [
        replace(row, note=unscorable_words(row.entry.unscorable, present.number))
        if row.entry.is_unscorable and not row.entry.withdrawn_at
        else row
        for row in table.rows
    ]
    return replace(table, rows=tuple(rows))


def unscorable_words(code: str, number: int) -> str:
    """Why an edition cannot score a file that a former one scored; nothing of the file itself is told.

    >>> unscorable_words("missing-keys", 3), unscorable_words("other", 3)
    ('Edition 3 added sequences that its file does not predict.', 'Edition 3 cannot score its file.')
    """
    return _WHY_UNSCORABLE.get(code, "Edition {} cannot score its file.").format(number)


@dataclass(frozen=True)
class PastRow:
    """One edition in the list of a split's editions."""

    past: editions.Past
    change: str  # since the edition that it followed


def past_rows(history: Iterable[editions.Past]) -> tuple[PastRow, ...]:
    """A split's editions, ready to be placed."""
    return tuple(past_row(past) for past in history)


def past_row(past: editions.Past) -> PastRow:
    """One edition, ready to be placed."""
    change = _change_words(past.change, past.followed, past.edition) if past.followed else "the first"
    return PastRow(past=past, change=change)


@dataclass(frozen=True)
class RescoredNotice:
    """What the last change of the board did to a submission, in words for its team."""

    publication: Publication
    heading: str  # before the date
    outcome: str  # after the reason


def rescored_notice(rescored: editions.Rescored | None) -> RescoredNotice | None:
    """The notice on a submission's page; None where the change of the board changed nothing for it."""
    if rescored is None:
        return None
    old, new, publication = rescored.old, rescored.new, rescored.publication
    former = publication.replaced
    if former is None:
        return None
    if old and new and old.status == new.status == Status.REJECTED:
        return None
    if publication.kind == Publication.Kind.ROLLED_BACK:
        heading = f"Edition {publication.edition.number} is the board again since"
    elif new and new.status == Status.SCORED:
        heading = f"Re-scored in edition {publication.edition.number} on"
    else:
        heading = f"Edition {publication.edition.number} became the board on"
    return RescoredNotice(publication, heading, _outcome(old, new, former.number))


def _outcome(old: Evaluation | None, new: Evaluation | None, former: int) -> str:
    """What became of one submission, by its MiD."""
    before, after = _mid(old), _mid(new)
    if new and new.status == Status.SCORED:
        return f"MiD stays {after}." if before == after else f"MiD {before} → {after}."
    kept = f" In edition {former} it keeps its result, MiD {before}." if before != NO_VALUE else ""
    if new is None or new.status == Status.CANCELLED:
        return f"This file was left out of it.{kept}"
    if new.status == Status.REJECTED:
        return f"It cannot score this file, for the reason below.{kept}"
    if new.status == Status.SYSTEM_ERROR:
        return f"Scoring this file in it failed by our fault.{kept}"
    return f"This file waits to be scored in it.{kept}"


def _mid(evaluation: Evaluation | None) -> str:
    if evaluation is None:
        return NO_VALUE
    mid = flat_scores(evaluation.scores.all())["mid"]
    return format_published(mid, decimals=evaluation.edition.decimals)


@dataclass(frozen=True)
class Running:
    """How far the re-scoring of an edition is. `seen` changes exactly when what is shown does."""

    edition: Edition
    progress: Progress
    counts: str
    pace: str

    @property
    def is_final(self) -> bool:
        """Whether nothing waits any more."""
        return self.progress.n_waiting == 0

    @property
    def seen(self) -> str:
        """What a waiting page sends along, to be told only what is new."""
        return f"{self.progress.n_done}-{self.progress.n_total}"


def running(edition: Edition, progress: Progress) -> Running:
    """A progress, ready to be drawn."""
    parts = [f"{grouped(progress.n_done)} of {grouped(progress.n_total)}"]
    if progress.n_rejected:
        parts.append(f"{grouped(progress.n_rejected)} rejected")
    if progress.n_failed:
        parts.append(f"{grouped(progress.n_failed)} failed by our fault")
    if progress.n_cancelled:
        parts.append(f"{grouped(progress.n_cancelled)} cancelled")
    pace = ""
    if progress.rate_per_s is not None:
        pace = f"{rate_words(progress.rate_per_s)}, about {duration(progress.left_s)} left"
    return Running(edition=edition, progress=progress, counts=", ".join(parts), pace=pace)


def rate_words(rate_per_s: float) -> str:
    """A rate in the unit in which it is more than one.

    >>> rate_words(41.7), rate_words(0.25)
    ('41.7 a second', '15 a minute')
    """
    return f"{rate_per_s:.1f} a second" if rate_per_s >= 1 else f"{60 * rate_per_s:.0f} a minute"


@dataclass(frozen=True)
class Difference:
    """One number before and after."""

    old: str
    new: str
    delta: str
    css: str


@dataclass(frozen=True)
class ChangeRow:
    """What a new edition does to one entry, ready to be placed."""

    change: Change
    old_rank: str
    new_rank: str
    status: str
    is_worse_off: bool  # was scored and will not be
    differences: tuple[Difference, ...]
    summary: str = ""  # why it is rejected now and was not, to the first colon
    reason: str = ""  # the same, whole
    n_more_problems: int = 0

    @property
    def is_moved(self) -> bool:
        """Whether its rank changes."""
        return self.old_rank != self.new_rank


@dataclass(frozen=True)
class ChangeTable:
    """Everything that the comparison's template places."""

    headings: tuple[Heading, ...]
    rows: tuple[ChangeRow, ...]
    truth: str
    totals: tuple[tuple[str, str], ...]


def change_table(found: Preview) -> ChangeTable:
    """A preview, ready to be drawn."""
    return ChangeTable(
        headings=tuple(score_heading(name) for name in SCORE_NAMES),
        rows=tuple(_change_row(change) for change in found.changes),
        truth=_change_words(found.truth, found.published, found.edition),
        totals=_totals(found),
    )


def _totals(found: Preview) -> tuple[tuple[str, str], ...]:
    truth = found.truth
    sequences: tuple[tuple[str, str], ...] = (("sequences", "not compared"),)
    if truth is not None:
        sequences = (
            ("sequences added", grouped(truth.n_added)),
            ("sequences removed", grouped(truth.n_removed)),
            ("labels changed", grouped(truth.n_changed)),
            ("another anno_id", "not counted" if truth.n_renumbered is None else grouped(truth.n_renumbered)),
        )
    return (
        *sequences,
        ("entries", grouped(len(found.changes))),
        ("entries change", grouped(found.n_changed)),
        ("change rank", grouped(found.n_moved)),
        ("become rejected", grouped(found.n_newly_rejected)),
    )


def _change_row(change: Change) -> ChangeRow:
    old_status, new_status = (_STATUS_LABELS[s] for s in (change.old_status, change.new_status))
    is_news = change.problems and change.old_status != change.new_status
    reason = change.problems[0]["message"] if is_news else ""
    return ChangeRow(
        change=change,
        old_rank=_rank(change.old_rank),
        new_rank=_rank(change.new_rank),
        status=new_status if old_status == new_status else f"{new_status}, was {old_status}",
        is_worse_off=change.old_status == Status.SCORED and change.new_status in _ENDED_BADLY,
        differences=tuple(_difference(name, change) for name in SCORE_NAMES),
        summary=reason.partition(": ")[0],
        reason=reason,
        n_more_problems=max(0, len(change.problems) - 1),
    )


def _difference(name: str, change: Change) -> Difference:
    delta = change.delta[name]
    css = {"mid": "primary first", "rte": "overall first"}.get(name, "")
    return Difference(
        old=format_published(change.old[name], decimals=change.old_decimals),
        new=format_published(change.new[name], decimals=change.new_decimals),
        delta=delta_words(delta, decimals=max(change.old_decimals, change.new_decimals)),
        css=css if delta else f"{css} same".strip(),
    )


def delta_words(delta: float | None, *, decimals: int = 2) -> str:
    """A difference with its sign.

    >>> delta_words(0.09), delta_words(-1.5), delta_words(0.0), delta_words(None)
    ('+0.09', '−1.50', '0.00', '')
    """
    if delta is None:
        return ""
    return f"{delta:+.{decimals}f}".replace("-", "−") if delta else f"{0:.{decimals}f}"


def _rank(rank: int | None) -> str:
    return NO_VALUE if rank is None else str(rank)


@dataclass(frozen=True)
class DeskRow:
    """One split on the maintainers' desk, ready to be placed."""

    desk: editions.Desk
    change: str  # since the edition that the board would go back to
    running: tuple[Running, ...]


def desk_row(desk: editions.Desk) -> DeskRow:
    """A desk, ready to be drawn."""
    published, former = desk.published, desk.predecessor
    return DeskRow(
        desk=desk,
        change=change_words(former, published) if former and published else "",
        running=tuple(running(edition, progress) for edition, progress in desk.in_preparation),
    )
