"""Who stands where: the board of a split in one edition, submissions and published rows together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db.models import Prefetch, Q, QuerySet

from evaluator import ranking
from evaluator.protocol import SCORE_NAMES
from leaderboard.models import (
    Edition,
    Evaluation,
    Method,
    PublishedResult,
    Score,
    Split,
    Status,
    Submission,
    User,
    Visibility,
)

PRIMARY = "mid"
TEXT_COLUMNS = ("rank", "method", "team", "date")
SORTABLE = (*TEXT_COLUMNS, *SCORE_NAMES)


class UnknownColumn(ValueError):
    """The board has no such column to sort by."""

    def __init__(self, column: str) -> None:
        super().__init__(
            f"The board cannot be sorted by {column!r}; expected one of {', '.join(SORTABLE)}, "
            "with a leading '-' for the reverse."
        )


@dataclass(frozen=True)
class Entry:
    """One row of a board. `scores` maps the ten names to published values; None where there is none."""

    kind: str  # "submission" or "published"
    method: str
    team: str
    scores: Mapping[str, float | None]
    description: str = ""
    rank: int | None = None
    date: datetime | None = None
    year: int | None = None
    method_id: UUID | None = None
    submission_id: UUID | None = None
    paper_url: str = ""
    code_url: str = ""
    source: str = ""  # a published row's citation
    best: frozenset[str] = frozenset()
    second: frozenset[str] = frozenset()
    is_mine: bool = False
    is_visible_to_all: bool = True

    @property
    def date_text(self) -> str:
        """The date as shown: a day for submissions, a year for published rows."""
        return f"{self.date:%Y-%m-%d}" if self.date else str(self.year or "")


@dataclass(frozen=True)
class Board:
    """A ranked board: one split, one edition, one point in time."""

    split: Split
    edition: Edition | None
    entries: tuple[Entry, ...]
    sort: str = "rank"
    updated_at: datetime | None = None
    is_open: bool = field(default=False)

    @property
    def n_submissions(self) -> int:
        """How many rows are submissions."""
        return sum(entry.kind == "submission" for entry in self.entries)


def flat_scores(scores: Iterable[Score]) -> dict[str, float | None]:
    """The ten names and their values; None where an interval is empty."""
    values: dict[str, float | None] = dict.fromkeys(SCORE_NAMES)
    for score in scores:
        name = score.metric if score.interval == "overall" else f"{score.metric}_{score.interval}"
        values[name] = score.value
    return values


def board(
    *, split: Split, edition: Edition | None = None, viewer: User | AnonymousUser, sort: str = "rank"
) -> Board:
    """The board of a split in one edition (the published one unless named), as `viewer` may see it.

    Ranks are by published MiD among everything that everybody sees; ties share a rank; a row without that
    value has none. Each method is represented by the best of its standing submissions. Rows that only the
    viewer's own team sees carry the rank that they would have, and take nobody's place.
    Raises `UnknownColumn`.
    """
    if sort.removeprefix("-") not in SORTABLE:
        raise UnknownColumn(sort)
    edition = edition or split.published_edition
    entries = [_published_entry(result) for result in split.published_results.all()]
    submitted = _submitted_entries(edition, viewer) if edition else []
    ranked = _marked(_ranked([*entries, *submitted]))
    dates = [entry.date for entry in submitted if entry.date]
    if edition and edition.published_at:
        dates.append(edition.published_at)
    return Board(
        split=split,
        edition=edition,
        entries=tuple(_sorted(ranked, sort)),
        sort=sort,
        updated_at=max(dates, default=None),
        is_open=split.accepts_submissions(),
    )


def _published_entry(result: PublishedResult) -> Entry:
    return Entry(
        kind="published",
        method=result.method_name,
        team=result.authors,
        description=result.description,
        scores={name: result.scores.get(name) for name in SCORE_NAMES},
        year=result.year,
        paper_url=result.source_url,
        code_url=result.code_url,
        source=f"{result.authors} ({result.year}). {result.source_title}. {result.source_table}.",
    )


def _submitted_entries(edition: Edition, viewer: User | AnonymousUser) -> list[Entry]:
    """One entry for each method that the viewer may see: the best of its standing submissions."""
    rows = (
        Evaluation.objects.filter(
            edition=edition,
            status=Status.SCORED,
            submission__withdrawn_at=None,
            submission__method__in=_shown_methods(viewer),
        )
        .select_related("submission__method__team")
        .prefetch_related(Prefetch("scores", queryset=Score.objects.order_by("pk")))
    )
    mine = _team_ids(viewer)
    best: dict[UUID, Entry] = {}
    for evaluation in rows:
        entry = _submitted_entry(evaluation.submission, flat_scores(evaluation.scores.all()), mine)
        assert entry.method_id is not None  # noqa: S101 - for the type checker: every submission has a method
        rival = best.get(entry.method_id)
        if rival is None or _key(entry) < _key(rival):
            best[entry.method_id] = entry
    return list(best.values())


def _shown_methods(viewer: User | AnonymousUser) -> QuerySet[Method, dict[str, UUID]]:
    """Public methods, and the viewer's own team's; a maintainer's board is the public one as well."""
    shown = Q(visibility=Visibility.PUBLIC)
    if viewer.is_authenticated:
        shown |= Q(team__memberships__user=viewer)
    return Method.objects.filter(shown).values("pk")


def _team_ids(viewer: User | AnonymousUser) -> set[UUID]:
    if not viewer.is_authenticated:
        return set()
    return set(viewer.teams.values_list("pk", flat=True))


def _submitted_entry(submission: Submission, scores: Mapping[str, float | None], mine: set[UUID]) -> Entry:
    method = submission.method
    return Entry(
        kind="submission",
        method=method.name,
        team=method.team.name,
        description=method.description,
        scores=scores,
        date=submission.submitted_at,
        method_id=method.pk,
        submission_id=submission.pk,
        paper_url=method.paper_url,
        code_url=method.code_url,
        is_mine=method.team_id in mine,
        is_visible_to_all=method.visibility == Visibility.PUBLIC,
    )


def _key(entry: Entry) -> tuple[bool, float, datetime]:
    """Better first: a value before none, lower before higher, earlier before later."""
    value = entry.scores[PRIMARY]
    assert entry.date is not None  # noqa: S101 - for the type checker: every submission has a date
    return (value is None, value or 0.0, entry.date)


def _ranked(entries: list[Entry]) -> list[Entry]:
    """Give every entry its rank among those that everybody sees."""
    public = [entry.scores[PRIMARY] for entry in entries if entry.is_visible_to_all]
    public_ranks = iter(ranking.rank(public))
    return [
        replace(
            entry,
            rank=next(public_ranks)
            if entry.is_visible_to_all
            else ranking.rank([*public, entry.scores[PRIMARY]])[-1],
        )
        for entry in entries
    ]


def _marked(entries: list[Entry]) -> list[Entry]:
    """Mark the best and the second of each column among what everybody sees."""
    best: dict[int, set[str]] = {}
    second: dict[int, set[str]] = {}
    for name in SCORE_NAMES:
        column = [entry.scores[name] if entry.is_visible_to_all else None for entry in entries]
        firsts, seconds = ranking.best_and_second(column)
        for index in firsts:
            best.setdefault(index, set()).add(name)
        for index in seconds:
            second.setdefault(index, set()).add(name)
    return [
        replace(entry, best=frozenset(best.get(i, ())), second=frozenset(second.get(i, ())))
        for i, entry in enumerate(entries)
    ]


def _sorted(entries: list[Entry], sort: str) -> list[Entry]:
    """In the order of one column; rows without a value come last either way, ties by rank and name."""
    column = sort.removeprefix("-")
    in_rank_order = sorted(
        entries, key=lambda e: (e.rank is None, e.rank or 0, e.method.casefold(), e.date_text)
    )

    def value(entry: Entry) -> str | float | int | None:
        if column in SCORE_NAMES:
            return entry.scores[column]
        if column == "rank":
            return entry.rank
        if column == "date":
            return entry.date_text or None
        return (entry.method if column == "method" else entry.team).casefold()

    valued = [entry for entry in in_rank_order if value(entry) is not None]
    without = [entry for entry in in_rank_order if value(entry) is None]
    valued.sort(key=value, reverse=sort.startswith("-"))  # type: ignore[arg-type,return-value]  # one column, one type
    return [*valued, *without]
