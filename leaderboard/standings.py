"""Who stands where: the board of a split in one edition, submissions and published rows together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db.models import Q, QuerySet
from django.utils.dateparse import parse_date, parse_datetime

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


class BadMoment(ValueError):
    """The text is no point in time."""

    def __init__(self, text: str) -> None:
        super().__init__(
            f"{text[:60]!r} is no date or time; expected one such as 2026-11-20 or 2026-11-20T18:00:00Z."
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
    withdrawn_at: datetime | None = None  # a tombstone: the row stays, without values
    is_unscorable: bool = False  # of a former edition, whose successor cannot score the file

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
    at: datetime | None = None
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
        values[_name(score.metric, score.interval)] = score.value
    return values


def scores_in(edition: Edition) -> dict[UUID, dict[str, float | None]]:
    """The ten names and their values of every evaluation in an edition: one query, whatever their number."""
    found: dict[UUID, dict[str, float | None]] = {}
    rows = Score.objects.filter(evaluation__edition=edition)
    for pk, metric, interval, value in rows.values_list("evaluation_id", "metric", "interval", "value"):
        found.setdefault(pk, dict.fromkeys(SCORE_NAMES))[_name(metric, interval)] = value
    return found


def _name(metric: str, interval: str) -> str:
    return metric if interval == "overall" else f"{metric}_{interval}"


def parse_moment(text: str) -> datetime:
    """A point in time from a date (its end, in UTC) or an ISO time. Raises `BadMoment`."""
    try:
        # The date first: an ISO time may leave out its time of day, and would then mean the day's beginning.
        moment = parse_date(text) or parse_datetime(text)
        if moment is None:
            raise BadMoment(text)
        if not isinstance(moment, datetime):
            return datetime.combine(moment, time.max, tzinfo=UTC)
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise BadMoment(text) from None


def board(
    *,
    split: Split,
    edition: Edition | None = None,
    viewer: User | AnonymousUser,
    sort: str = "rank",
    at: datetime | None = None,
) -> Board:
    """The board of a split in one edition (the published one unless named), as `viewer` may see it.

    With `at` the board as it stood then: the edition that was published, with what it had scored by then.
    Ranks are by published MiD among everything that everybody sees; ties share a rank; a row without that
    value has none. Each method is represented by the best of its standing submissions; one whose submissions
    were all withdrawn leaves a row without values. Rows that only the viewer's own team sees carry the rank
    that they would have, and take nobody's place. Raises `UnknownColumn`.
    """
    if sort.removeprefix("-") not in SORTABLE:
        raise UnknownColumn(sort)
    edition = edition or (_edition_at(split, at) if at else split.published_edition)
    entries = [_published_entry(result) for result in split.published_results.all()]
    submitted = _submitted_entries(split, edition, viewer, at) if edition else []
    ranked = _marked(_ranked([*entries, *submitted]))
    dates = [entry.date for entry in submitted if entry.date]
    if edition and edition.published_at:
        dates.append(edition.published_at)
    return Board(
        split=split,
        edition=edition,
        entries=tuple(_sorted(ranked, sort)),
        sort=sort,
        at=at,
        updated_at=max(dates, default=None),
        is_open=split.accepts_submissions(),
    )


def _edition_at(split: Split, at: datetime) -> Edition | None:
    """The edition that was the board at that time."""
    publication = (
        split.publications.filter(at__lte=at)
        .select_related("edition__ground_truth")
        .order_by("-at", "-pk")
        .first()
    )
    return publication.edition if publication else None


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


def _submitted_entries(
    split: Split, edition: Edition, viewer: User | AnonymousUser, at: datetime | None
) -> list[Entry]:
    """One entry for each method that the viewer may see: the best of its standing submissions."""
    rows = Evaluation.objects.filter(
        edition=edition, status=Status.SCORED, submission__method__in=_shown_methods(viewer)
    ).select_related("submission__method__team")
    if at is not None:
        rows = rows.filter(finished_at__lte=at)
    mine = _team_ids(viewer)
    unscorable = _unscorable(split, edition)
    # The evaluations first: one that is scored has its scores already, written in the same transaction.
    evaluations = list(rows)
    scores = scores_in(edition)
    best: dict[UUID, Entry] = {}
    for evaluation in evaluations:
        entry = _submitted_entry(
            evaluation,
            scores.get(evaluation.pk) or flat_scores([]),
            mine,
            at=at,
            is_unscorable=evaluation.submission_id in unscorable,
        )
        method_id = evaluation.submission.method_id
        rival = best.get(method_id)
        if rival is None or _key(entry) < _key(rival):
            best[method_id] = entry
    return list(best.values())


def _unscorable(split: Split, edition: Edition) -> set[UUID]:
    """Submissions of a former edition that the published one rejects: its manifest has other keys."""
    if split.published_edition_id in {None, edition.pk}:
        return set()
    rejected = Evaluation.objects.filter(edition=split.published_edition_id, status=Status.REJECTED)
    return set(rejected.values_list("submission", flat=True))


def _shown_methods(viewer: User | AnonymousUser) -> QuerySet[Method]:
    """Public methods, and the viewer's own team's; a maintainer's board is the public one as well."""
    shown = Q(visibility=Visibility.PUBLIC)
    if viewer.is_authenticated:
        shown |= Q(team__memberships__user=viewer)
    return Method.objects.filter(shown)


def _team_ids(viewer: User | AnonymousUser) -> set[UUID]:
    if not viewer.is_authenticated:
        return set()
    return set(viewer.teams.values_list("pk", flat=True))


def _submitted_entry(
    evaluation: Evaluation,
    scores: Mapping[str, float | None],
    mine: set[UUID],
    *,
    at: datetime | None,
    is_unscorable: bool,
) -> Entry:
    submission = evaluation.submission
    method = submission.method
    withdrawn_at = submission.withdrawn_at
    if at is not None and withdrawn_at is not None and withdrawn_at > at:
        withdrawn_at = None
    return Entry(
        kind="submission",
        method=method.name,
        team=method.team.name,
        description=method.description,
        scores=flat_scores([]) if withdrawn_at else scores,
        date=submission.submitted_at,
        method_id=method.pk,
        submission_id=submission.pk,
        paper_url=method.paper_url,
        code_url=method.code_url,
        is_mine=method.team_id in mine,
        is_visible_to_all=method.visibility == Visibility.PUBLIC,
        withdrawn_at=withdrawn_at,
        is_unscorable=is_unscorable,
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
    valued.sort(key=value, reverse=sort.startswith("-"))  # type: ignore[arg-type]  # one column, one type
    return [*valued, *without]
