"""Comparisons: two to five entries of an edition side by side, each pair with its difference, interval and p.

A reader asks, and is answered at once with what is known. What is not known yet is noted as a row, and a
worker computes it: recordings are compared, and only workers have their values. Asked again a moment later,
the answer is complete.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

from django.contrib.auth.models import AnonymousUser

from evaluator import Difference
from evaluator.metrics.protocol import PRIMARY
from evaluator.scoring import differences
from evaluator.scoring.significance import Influence
from evaluator.tables import sentences
from leaderboard.boards import listing, rows, snapshots
from leaderboard.boards.rows import Entry
from leaderboard.models import Comparison, Edition, Method, Split, User
from leaderboard.statistics import confidence, disclosure, questions, recording_sums
from leaderboard.statistics.questions import Key

MIN_METHODS, MAX_METHODS = 2, 5
N_FIRST = 20
# Beside the differences of a pair of which a worker tells no more, why it does not.
WITHHELD = "withheld"


class BadComparison(Exception):
    """The comparison that was asked for makes no sense; the text says what was found and what is expected.

    `code` is stable: bad-comparison, unknown-method, not-on-the-board.
    """

    code = "bad-comparison"


class UnknownMethod(BadComparison):
    """A method that does not exist or that this reader may not see; the answer is the same."""

    code = "unknown-method"


def method_id(text: str) -> UUID:
    """The method that an address names. Raises `UnknownMethod`."""
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

    A column without sequences is not in `differences`. `withheld` says why they have neither interval nor p
    where nobody is told those; it is empty otherwise.
    """

    first: Entry
    second: Entry
    differences: Mapping[str, Difference] | None
    withheld: str = ""

    def sentence(self, name: str = PRIMARY) -> str:
        """What the difference in one column means, in words; empty while it is not known."""
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
        """On how few recordings the difference in MiD rests; empty where that is withheld."""
        gap = (self.differences or {}).get(PRIMARY)
        return sentences.influence(self.first.method, self.second.method, difference=gap) if gap else ""

    def others(self) -> str:
        """How many columns besides overall MiD differ significantly."""
        return sentences.others(self.differences or {})


@dataclass(frozen=True)
class Compared:
    """The answer: entries in the order that was asked for, all pairs of them, and whether all is computed.

    An entry is the method's row of the board as this reader sees it, pseudonym, values and intervals
    included. `reason` says why there are no intervals where there are none, and is empty otherwise.
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
) -> Compared:
    """Compare two to five methods of one board: the published edition's unless another is named.

    Pairs that no worker has compared yet have `differences` None; they are asked for, and the workers told.
    Of pairs that `disclosure.why_withheld` names, there is the difference of the published values alone.
    What a visitor asks for is counted by the `address` that they ask from. Raises `BadComparison` for another
    number of methods or the same one twice, `UnknownMethod` for one that the viewer may not see,
    `NotOnTheBoard` for one without a value there, `questions.AskedTooOften`.
    """
    board = snapshots.board(split=split, edition=edition, viewer=viewer)
    if board.edition is None:
        raise NotOnTheBoard(f"The split {split.pk} has no board yet; expected one with ground truth.")
    # It is at hand, and would be asked for again.
    board.edition.split = board.split
    chosen = _chosen(board, methods, viewer)
    asked = list(itertools.combinations(chosen, 2))
    withheld = _withheld(board.edition, asked)
    known = _known(board.edition, chosen)
    new = [key for key in map(_key, asked) if key not in withheld and not _is_asked_for(known.get(key))]
    questions.ask(edition=board.edition, pairs=new, user=viewer, address=address, now=now)
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
    """All pairs of the first rows of a board that everybody sees, each with the better rank first.

    What is not known yet is noted, for workers to compute after all that somebody waits for. Empty for a
    board of another time, and where there are too few recordings to compare anything.
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
    questions.note(edition=board.edition, pairs=new)
    return _pairs(pairs, known, withheld)


def neighbours(pairs: Sequence[Pair]) -> list[Pair]:
    """Of all pairs of some rows, those of two rows that follow each other."""
    firsts = list(dict.fromkeys(pair.first.evaluation_id for pair in pairs))
    is_first = dict.fromkeys(firsts, True)
    return [pair for pair in pairs if is_first.pop(pair.first.evaluation_id, False)]


def _chosen(board: listing.Board, methods: Sequence[UUID], viewer: User | AnonymousUser) -> list[Entry]:
    """The methods' rows, in the order that was asked for."""
    if not MIN_METHODS <= len(methods) <= MAX_METHODS:
        raise BadComparison(
            f"A comparison needs {MIN_METHODS} to {MAX_METHODS} methods; found {len(methods)}."
        )
    if len(set(methods)) < len(methods):
        raise BadComparison("One method is given twice; expected different methods to compare.")
    entry_of = {entry.method_id: entry for entry in board.entries if entry.scores[PRIMARY] is not None}
    for pk in methods:
        if pk not in entry_of:
            if Method.objects.visible_to(viewer).filter(pk=pk).exists():
                raise NotOnTheBoard(f"The method {pk} has no scored submission on {board.split.pk}.")
            raise UnknownMethod(f"There is no method {pk} that you may see; expected one of the board.")
    return [entry_of[pk] for pk in methods]


def _withheld(edition: Edition, pairs: Sequence[tuple[Entry, Entry]]) -> dict[Key, str]:
    """Why the interval and p of a pair are withheld, by its key; no other pairs."""
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
    """A pair is kept once, under its evaluations in ascending order."""
    first, second = sorted([_evaluation_id(pair[0]), _evaluation_id(pair[1])])
    return first, second


def _evaluation_id(entry: Entry) -> UUID:
    assert entry.evaluation_id is not None  # noqa: S101 - for the type checker: rows of submissions have one
    return entry.evaluation_id


def _known(edition: Edition, chosen: Sequence[Entry]) -> dict[Key, Comparison]:
    """What was asked for before, computed or not."""
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
    """Compare the two entries of a row, unit by unit, and write their differences, once.

    Raises what `bags.sums_of` raises; the row waits on then.
    """
    questions.begin(row, now=now)
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
    """The published difference of each column between these values, with its interval and p."""
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
