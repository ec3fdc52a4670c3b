"""The row of a board, its rank, and the details of a method that a reader may see.

An anonymous method is masked here, once, for every page and format.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Final, NamedTuple
from uuid import UUID

from evaluator.metrics import registry
from evaluator.metrics.protocol import Protocol, primary_of, primary_value, score_name
from leaderboard.methods.details import Details, details_of, stated
from leaderboard.models import (
    Edition,
    EditionRanges,
    Evaluation,
    Method,
    PublishedResult,
    Score,
    Visibility,
    days,
)
from leaderboard.models.benchmark import SINCE_EVER

ANONYMOUS_TEAM = "Anonymous"
OTHER_REASON = "other"
# Why a file cannot be scored in another edition, if the reason is about that edition: everybody sees it.
_SHOWN_REASONS = ("missing-keys", "unknown-keys", "undefined-error")


@dataclass(frozen=True)
class Profile:
    """The details of a method that a reader sees."""

    name: str
    team: str
    description: str = ""
    paper_url: str = ""
    code_url: str = ""
    details: Details = field(default_factory=stated)


@dataclass(frozen=True, slots=True)
class ConfidenceInterval:
    """The 95% confidence interval of a value, and its rank range; None until a worker has computed it.

    `reason` says why there will be no interval, for readers who ask.
    """

    low: float | None = None
    high: float | None = None
    rank_low: int | None = None
    rank_high: int | None = None
    reason: str = ""

    @property
    def is_with_best(self) -> bool | None:
        """Whether it is possibly the best of its column."""
        return None if self.rank_low is None else self.rank_low == 1


_UNKNOWN = ConfidenceInterval()
# By the evaluation's id a pair of ranks for each column of the protocol.
KeptRanges = Mapping[str, Sequence[Sequence[int] | None]]
NO_RANGES: Final[KeptRanges] = {}


@dataclass(frozen=True, slots=True)
class Entry:
    """A row of a board. `scores` has the names of its edition's protocol; None for no value."""

    kind: str  # "submission" or "published"
    method: str
    team: str
    scores: Mapping[str, float | None]
    description: str = ""
    decimals: int = 2  # of its values: the edition's, or as many as the paper printed
    rank: int | None = None
    date: datetime | None = None
    year: int | None = None
    method_id: UUID | None = None
    slug: str = ""  # of a quoted row: its short name in the file of published results
    submission_id: UUID | None = None
    evaluation_id: UUID | None = None
    paper_url: str = ""
    code_url: str = ""
    source: str = ""  # a published row's citation
    source_title: str = ""  # of the paper in it
    details: Details = field(default_factory=stated)
    # Scored submissions of the team's public methods to the split; of an anonymous or private one its own.
    n_attempts: int | None = None
    intervals: Mapping[str, ConfidenceInterval] = field(default_factory=dict)  # by score name, where computed
    best: frozenset[str] = frozenset()
    second: frozenset[str] = frozenset()
    is_mine: bool = False
    visibility: str = Visibility.PUBLIC
    pseudonym: str = ""  # of one's own anonymous row: under which everybody else sees it
    shown_at: datetime | None = None  # since when everybody sees its method
    withdrawn_at: datetime | None = None  # a tombstone: the row stays, without values
    unscorable: str = ""  # of an earlier edition: the code of why the published one cannot score the file

    @property
    def id(self) -> str:
        """The unique name of the row: a method's id, or `published:` and a slug."""
        return str(self.method_id) if self.method_id else f"published:{self.slug}"

    @property
    def primary(self) -> str:
        """The name of the score that ranks."""
        return primary_of(self.scores)

    @property
    def value(self) -> float | None:
        """The score that ranks."""
        return primary_value(self.scores)

    @property
    def interval(self) -> ConfidenceInterval:
        """Where the score that ranks may lie, and its rank."""
        return self.intervals.get(self.primary, _UNKNOWN)

    @property
    def is_unscorable(self) -> bool:
        """Tell whether the published edition cannot score its file."""
        return bool(self.unscorable)

    @property
    def is_visible_to_all(self) -> bool:
        return self.visibility != Visibility.PRIVATE

    @property
    def listed_at(self) -> datetime | None:
        """Return since when the row can be on the board: submitted, and its method shown."""
        return max((at for at in (self.date, self.shown_at) if at), default=None)

    @property
    def date_text(self) -> str:
        return f"{self.date:%Y-%m-%d}" if self.date else str(self.year or "")


def profile_of(method: Method, *, is_masked: bool = False) -> Profile:
    """The profile of a method. Masked: its pseudonym, and its details but for free texts."""
    details = details_of(method, is_masked=is_masked)
    if is_masked:
        return Profile(name=method.pseudonym, team=ANONYMOUS_TEAM, details=details)
    return Profile(
        name=method.name,
        team=method.team.name,
        description=method.description,
        paper_url=method.paper_url,
        code_url=method.code_url,
        details=details,
    )


def quoted_entry(result: PublishedResult, *, rules: Protocol) -> Entry:
    """Make the row of a published result on a board of this protocol."""
    return Entry(
        kind="published",
        slug=result.slug,
        method=result.method_name,
        team=result.authors,
        description=result.description,
        scores={name: result.scores.get(name) for name in rules.score_names},
        decimals=printed_decimals(result.scores.values()),
        year=result.year,
        paper_url=result.source_url,
        code_url=result.code_url,
        source=f"{result.authors} ({result.year}). {result.source_title}, {result.source_table}.",
        source_title=result.source_title,
        details=stated(uses_nerf=result.uses_nerf, latency_ms=result.latency_ms, hardware=result.hardware),
        shown_at=result.added_at if result.added_at > SINCE_EVER else None,
    )


def printed_decimals(values: Iterable[float | None]) -> int:
    """With how many decimals a row was printed: one, or two where any of its values has two.

    >>> printed_decimals([14.8, 55.0]), printed_decimals([14.82, 55.0])
    (1, 2)
    """
    known = [value for value in values if value is not None]
    return 1 if all(round(value, 1) == value for value in known) else 2


def named(profile: Profile) -> dict[str, Any]:
    fields = {
        name: getattr(profile, name) for name in ("team", "description", "paper_url", "code_url", "details")
    }
    return {"method": profile.name, **fields}


def submitted_entry(
    evaluation: Evaluation,
    scored: "Scored",
    *,
    profile: Profile,
    decimals: int,
    withdrawn_at: datetime | None = None,
    unscorable: str = "",
) -> Entry:
    """Make the row of a submission, with the printed `decimals` of its edition."""
    submission = evaluation.submission
    method = submission.method
    return Entry(
        kind="submission",
        **named(profile),
        decimals=decimals,
        scores=dict.fromkeys(scored.values) if withdrawn_at else scored.values,
        intervals={} if withdrawn_at else scored.intervals,
        date=days.truncate_to_day(submission.submitted_at, is_masked=method.is_masked),
        method_id=submission.method_id,
        submission_id=submission.pk,
        evaluation_id=evaluation.pk,
        visibility=method.visibility,
        shown_at=days.truncate_to_day_or_none(method.shown_at, is_masked=method.is_masked),
        withdrawn_at=days.truncate_to_day_or_none(withdrawn_at, is_masked=method.is_masked),
        unscorable=unscorable,
    )


def public_reason(problems: Iterable[Mapping[str, str]]) -> str:
    """The public code of the reason why an edition cannot score a file that another one scored.

    >>> public_reason([{"code": "not-finite"}, {"code": "missing-keys"}])
    'missing-keys'
    """
    codes = (problem["code"] for problem in problems)
    return next((code for code in codes if code in _SHOWN_REASONS), OTHER_REASON)


# --- their values ----------------------------------------------------------------------------------------


class Scored(NamedTuple):
    values: Mapping[str, float | None]
    intervals: Mapping[str, ConfidenceInterval]


def _scored(cells: Mapping[str, tuple[float, ConfidenceInterval]], rules: Protocol) -> Scored:
    # In the order of the protocol, so that a row has the same bytes whenever it is read.
    return Scored(
        {name: cells[name][0] if name in cells else None for name in rules.score_names},
        {name: cells[name][1] for name in rules.score_names if name in cells and cells[name][1] != _UNKNOWN},
    )


def flat_scores(evaluation: Evaluation) -> Mapping[str, float | None]:
    """Return the scores by the names of the protocol; None where a TTC range is empty."""
    return scored_of(evaluation).values


def scored_of(evaluation: Evaluation) -> Scored:
    cells = {
        score_name(score.metric, score.ttc_range): (score.value, ConfidenceInterval(score.low, score.high))
        for score in evaluation.scores.all()
    }
    return _scored(cells, evaluation.edition.rules)


def scored_in(
    edition: Edition, *, evaluations: Collection[UUID] | None = None, ranges: KeptRanges = NO_RANGES
) -> Mapping[UUID, Scored]:
    """Return values and intervals of every evaluation in an edition, or of these, by one query.

    `ranges_in(edition)` adds the rank ranges of the present entries.
    """
    rules, nothing = edition.rules, [None] * len(edition.rules.score_names)
    rows = Score.objects.filter(evaluation__edition=edition)
    if evaluations is not None:
        rows = rows.filter(evaluation__in=evaluations)
    cells: dict[UUID, dict[str, tuple[float, ConfidenceInterval]]] = {pk: {} for pk in evaluations or ()}
    for pk, metric, ttc_range, value, low, high in rows.values_list(
        "evaluation_id", "metric", "ttc_range", "value", "low", "high"
    ):
        name = score_name(metric, ttc_range)
        pair = ranges.get(str(pk), nothing)[rules.score_names.index(name)] or (None, None)
        cells.setdefault(pk, {})[name] = value, ConfidenceInterval(low, high, *pair)
    return {pk: _scored(row_cells, rules) for pk, row_cells in cells.items()}


def ranges_in(edition: Edition) -> KeptRanges:
    """Return the kept rank ranges of an edition."""
    return EditionRanges.objects.filter(edition=edition).values_list("ranges", flat=True).first() or NO_RANGES


def placed(entry: Entry, rank: int | None) -> Entry:
    """Give the row its rank; drop a rank range without it, which is of an earlier board."""
    interval = entry.interval
    if rank is None or interval.rank_low is None or interval.rank_high is None:
        return replace(entry, rank=rank)
    if interval.rank_low <= rank <= interval.rank_high:
        return replace(entry, rank=rank)
    unplaced = replace(interval, rank_low=None, rank_high=None)
    return replace(entry, rank=rank, intervals={**entry.intervals, entry.primary: unplaced})


SortKey = tuple[bool, float, datetime]


def key(value: float | None, submitted_at: datetime) -> SortKey:
    """Sort a method's submissions: a value before none, lower before higher, then earlier."""
    return (value is None, value or 0.0, submitted_at)


def in_ranks(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Rank the rows, and mark the best and the second of each column."""
    ranks = registry.rank([entry.value for entry in entries])
    names = list(entries[0].scores) if entries else []
    marks = {name: registry.best_and_second([entry.scores[name] for entry in entries]) for name in names}
    return tuple(
        replace(
            placed(entry, rank),
            best=frozenset(name for name, (best, _) in marks.items() if i in best),
            second=frozenset(name for name, (_, second) in marks.items() if i in second),
        )
        for i, (entry, rank) in enumerate(zip(entries, ranks, strict=True))
    )


def listed(entries: Sequence[Entry], *, by: str) -> list[Entry]:
    """Sort by one column; rows without a value come last, ties by rank, value and name."""
    column = by.removeprefix("-")
    in_rank_order = sorted(
        entries, key=lambda e: (e.rank or len(entries) + 1, e.value or 0, e.method.casefold())
    )

    def value(entry: Entry) -> str | float | int | None:
        if column in entry.scores:
            return entry.scores[column]
        if column == "rank":
            return entry.rank
        if column == "date":
            return entry.date_text or None
        return (entry.method if column == "method" else entry.team).casefold()

    valued = [entry for entry in in_rank_order if value(entry) is not None]
    without = [entry for entry in in_rank_order if value(entry) is None]
    valued.sort(key=value, reverse=by.startswith("-"))  # type: ignore[arg-type]  # one column, one type
    return [*valued, *without]
