"""Comparisons of two to five entries of an edition: each pair with its difference, interval and p.

A reader gets what is known at once. Unknown pairs are queued: only workers have the values of recordings.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

from django.contrib.auth.models import AnonymousUser

from evaluator import Difference
from evaluator.scoring import differences
from evaluator.scoring.significance import Influence
from evaluator.tables import sentences
from leaderboard.boards import listing, rows, snapshots
from leaderboard.boards.rows import Entry
from leaderboard.models import Comparison, Edition, Method, Split, User
from leaderboard.statistics import comparison_queue, confidence, disclosure, recording_sums
from leaderboard.statistics.comparison_queue import Key

MIN_METHODS, MAX_METHODS = 2, 5
N_FIRST = 20
# Beside the differences of a pair of which a worker tells no more, why it does not.
WITHHELD = "withheld"
QUOTED = "A row quoted from a paper cannot be tested: papers report no values per recording."


class BadComparison(Exception):
    """The comparison makes no sense. `code` is bad-comparison, unknown-method or not-on-the-board."""

    code = "bad-comparison"


class UnknownMethod(BadComparison):
    """The method does not exist or this reader may not see it; the answer is the same."""

    code = "unknown-method"


def method_id(text: str) -> UUID:
    """Parse the id of a method. Raises `UnknownMethod`."""
    try:
        return UUID(text)
    except ValueError:
        raise UnknownMethod(
            f"There is no method {text[:60]!r}; expected an identifier as in the address of a method's page."
        ) from None


class NotOnTheBoard(BadComparison):
    """The split has no board, or the method no scored submission on it."""

    code = "not-on-the-board"


@dataclass(frozen=True)
class Pair:
    """Two entries and their differences by score name: None until a worker has computed them.

    A column without sequences is missing. `withheld` says why there is neither interval nor p, if so.
    """

    first: Entry
    second: Entry
    differences: Mapping[str, Difference] | None
    withheld: str = ""

    @property
    def difference(self) -> Difference | None:
        """Return the difference in the score that ranks; None until a worker has computed it."""
        return (self.differences or {}).get(self.first.primary)

    def sentence(self, name: str = "") -> str:
        """Word the difference in a column (default: the one that ranks); empty while it is not known."""
        name = name or self.first.primary
        if self.differences is None or name not in self.differences:
            return ""
        first, second = self.first.method, self.second.method
        return sentences.sentence(
            first,
            second,
            name=name,
            difference=self.differences[name],
            decimals=self.first.decimals,
            withheld=self.withheld,
        )

    def influence(self) -> str:
        """Say on how few recordings the difference in what ranks rests; empty where that is withheld."""
        gap = self.difference
        return sentences.influence(self.first.method, self.second.method, difference=gap) if gap else ""

    def others(self) -> str:
        """Say how many columns besides the one that ranks differ significantly."""
        return sentences.others(self.differences or {}, primary=self.first.primary)


@dataclass(frozen=True)
class Compared:
    """A comparison: entries in the requested order, all pairs, and whether all is computed.

    Entries are rows of the board as this reader sees them. `reason` says why there are no intervals, if so.
    """

    split: Split
    edition: Edition
    entries: tuple[Entry, ...]
    pairs: tuple[Pair, ...]
    is_complete: bool
    reason: str


def compare(
    *,
    methods: Sequence[UUID],
    split: Split,
    viewer: User | AnonymousUser,
    now: datetime,
    edition: Edition | None = None,
    address: str = "",
    best_first: bool = False,
) -> Compared:
    """Compare two to five methods on the published board or a named edition.

    `best_first` orders three or more by the score that ranks. Queues pairs that are not computed; they have
    `differences` None. Pairs that `disclosure.why_withheld` names have only the difference of the published
    values. Raises `BadComparison`, `UnknownMethod`, `NotOnTheBoard`, and
    `comparison_queue.TooManyComparisons` by account or `address`.
    """
    board = snapshots.board(split=split, edition=edition, viewer=viewer)
    if board.edition is None:
        raise NotOnTheBoard(f"The split {split.title} has no board yet; expected one with ground truth.")
    # It is at hand, and would be asked for again.
    board.edition.split = board.split
    chosen = _chosen(board, methods, viewer)
    if best_first and len(chosen) > MIN_METHODS:
        chosen.sort(key=lambda entry: math.inf if entry.value is None else entry.value)
    asked = list(itertools.combinations(chosen, 2))
    withheld = _withheld(board.edition, asked)
    known = _known(board.edition, chosen)
    new = [key for key in map(_key, asked) if key not in withheld and not _is_asked_for(known.get(key))]
    comparison_queue.ask(edition=board.edition, pairs=new, user=viewer, address=address, now=now)
    pairs = _pairs(asked, known, withheld)
    return Compared(
        split=split,
        edition=board.edition,
        entries=tuple(chosen),
        pairs=pairs,
        is_complete=all(pair.differences is not None for pair in pairs),
        reason=confidence.why_no_interval(board.edition),
    )


def of_first(*, board: listing.Board) -> tuple[Pair, ...]:
    """Return all pairs of the first public rows of a board, the better rank first; queue unknown ones last.

    Empty for a board of the past, and with too few recordings.
    """
    if board.edition is None or board.at is not None or confidence.why_no_interval(board.edition):
        return ()
    board.edition.split = board.split  # as above
    ranked = [
        entry for entry in board.entries if entry.is_visible_to_all and entry.evaluation_id and entry.rank
    ]
    first = sorted(ranked, key=lambda entry: entry.rank or 0)[:N_FIRST]
    pairs = list(itertools.combinations(first, 2))
    withheld, known = _withheld(board.edition, pairs), _known(board.edition, first)
    new = [key for key in map(_key, pairs) if key not in withheld and key not in known]
    comparison_queue.add(edition=board.edition, pairs=new)
    return _pairs(pairs, known, withheld)


def against(entry: Entry, others: Sequence[Entry], *, edition: Edition) -> tuple[Pair, ...]:
    """Return the pairs of an entry with each of the others; queue unknown ones last.

    With a quoted row, and where there are too few units, the pair has the differences of the values alone.
    """
    reason = confidence.why_no_interval(edition)
    whys = {other.id: reason if other.evaluation_id else QUOTED for other in others}
    tested = [(entry, other) for other in others if not whys[other.id]]
    withheld, known = _withheld(edition, tested), _known(edition, [each for pair in tested for each in pair])
    new = [key for key in map(_key, tested) if key not in withheld and key not in known]
    comparison_queue.add(edition=edition, pairs=new)
    pairs = {pair.second.id: pair for pair in _pairs(tested, known, withheld)}
    for other in others:
        if why := whys[other.id]:
            decimals = max(entry.decimals, other.decimals)
            shown = _differences_of_values(entry.scores, other.scores, decimals=decimals)
            pairs[other.id] = Pair(entry, other, shown, withheld=why)
    return tuple(pairs[other.id] for other in others)


def neighbours(pairs: Sequence[Pair]) -> list[Pair]:
    """Return the pairs of two rows that follow each other."""
    firsts = list(dict.fromkeys(pair.first.evaluation_id for pair in pairs))
    is_first = dict.fromkeys(firsts, True)
    return [pair for pair in pairs if is_first.pop(pair.first.evaluation_id, False)]


def _chosen(board: listing.Board, methods: Sequence[UUID], viewer: User | AnonymousUser) -> list[Entry]:
    if not MIN_METHODS <= len(methods) <= MAX_METHODS:
        raise BadComparison(
            f"A comparison needs {MIN_METHODS} to {MAX_METHODS} methods; found {len(methods)}."
        )
    if len(set(methods)) < len(methods):
        raise BadComparison("One method is given twice; expected different methods to compare.")
    entry_of = {entry.method_id: entry for entry in board.entries if entry.value is not None}
    for pk in methods:
        if pk not in entry_of:
            if Method.objects.visible_to(viewer).filter(pk=pk).exists():
                raise NotOnTheBoard(f"The method {pk} has no scored submission on {board.split.title}.")
            raise UnknownMethod(f"There is no method {pk} that you may see; expected one of the board.")
    return [entry_of[pk] for pk in methods]


def _withheld(edition: Edition, pairs: Sequence[tuple[Entry, Entry]]) -> dict[Key, str]:
    whys = {_key(pair): disclosure.why_withheld(*pair, edition=edition) for pair in pairs}
    return {key: why for key, why in whys.items() if why}


def _differences_of_values(
    first: Mapping[str, float | None], second: Mapping[str, float | None], *, decimals: int
) -> dict[str, Difference]:
    values = ((name, one, second[name]) for name, one in first.items())
    return {
        name: Difference(round(one - other, decimals) + 0.0)
        for name, one, other in values
        if one is not None and other is not None
    }


def _key(pair: tuple[Entry, Entry]) -> Key:
    # A pair is kept once, under its evaluations in ascending order.
    first, second = sorted([_evaluation_id(pair[0]), _evaluation_id(pair[1])])
    return first, second


def _evaluation_id(entry: Entry) -> UUID:
    assert entry.evaluation_id is not None  # noqa: S101 - for the type checker: rows of submissions have one
    return entry.evaluation_id


def _known(edition: Edition, chosen: Sequence[Entry]) -> dict[Key, Comparison]:
    ids = [_evaluation_id(entry) for entry in chosen]
    asked = Comparison.objects.filter(edition=edition, first__in=ids, second__in=ids)
    return {(row.first_id, row.second_id): row for row in asked}


def _is_asked_for(row: Comparison | None) -> bool:
    return row is not None and (row.computed_at is not None or row.asked_at is not None)


def _pairs(
    asked: Sequence[tuple[Entry, Entry]], known: Mapping[Key, Comparison], withheld: Mapping[Key, str]
) -> tuple[Pair, ...]:
    pairs = []
    for first, second in asked:
        key = _key((first, second))
        row = known.get(key)
        if key in withheld:
            # Everybody can take these differences from the board.
            shown = _differences_of_values(first.scores, second.scores, decimals=first.decimals)
            pairs.append(Pair(first, second, shown, withheld=withheld[key]))
        elif row is None or row.differences is None:
            pairs.append(Pair(first, second, None))
        else:
            kept = {name: _parsed(row.differences[name]) for name in first.scores if name in row.differences}
            if row.first_id != first.evaluation_id:
                kept = {name: gap.turned() for name, gap in kept.items()}
            pairs.append(Pair(first, second, kept, withheld=row.differences.get(WITHHELD, "")))
    return tuple(pairs)


def _parsed(kept: Mapping[str, Any]) -> Difference:
    known = kept.get("influence")
    return Difference(**{**kept, "influence": Influence(**known) if known else None})


# --- a worker's work -------------------------------------------------------------------------------------


def compute(row: Comparison, *, now: datetime) -> None:
    """Compare the two entries of a row, unit by unit, and save their differences, once.

    Raises what `recording_sums.sums_of` raises; the row then waits on.
    """
    comparison_queue.begin(row, now=now)
    sent = (row.first.submission, row.second.submission)
    withheld = disclosure.why_withheld_by_mark(*sent, edition=row.edition)
    one, other = (rows.flat_scores(each) for each in (row.first, row.second))
    if withheld:
        shown = _differences_of_values(one, other, decimals=row.edition.decimals)
    else:
        shown = _differences(row, one, other)
    kept = {name: asdict(gap) for name, gap in shown.items()} | ({WITHHELD: withheld} if withheld else {})
    Comparison.objects.filter(pk=row.pk, computed_at=None).update(differences=kept, computed_at=now)


def _differences(
    row: Comparison, one: Mapping[str, float | None], other: Mapping[str, float | None]
) -> dict[str, Difference]:
    edition = row.edition
    sent = (row.first.submission.sent_file, row.second.submission.sent_file)
    first, second = (recording_sums.unit_sums_of(edition, file=file) for file in sent)
    by_column = differences.difference(
        first,
        second,
        recording_sums.unit_counts_of(edition),
        names=edition.rules.score_names,
        signs=confidence.generator_of(edition, purpose="signs"),
        unit=edition.unit,
    )
    if not disclosure.is_hidden(edition):
        # Each count would tell more of hidden labels, and of the recordings that a file was made to favour.
        by_column = differences.with_influence(
            by_column,
            differences=first - second,
            counts=recording_sums.unit_counts_of(edition),
            names=edition.rules.score_names,
            rng=confidence.generator_of(edition, purpose="influence"),
        )
    return {
        name: disclosure.published_difference(
            gap,
            differences.rounded_difference(
                gap, first=one[name], second=other[name], decimals=edition.decimals
            ),
            edition=edition,
        )
        for name, gap in by_column.items()
    }
