"""Who stands where: the board of a split in one edition, submissions and published rows together."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db.models import Count, Exists, OuterRef, Q
from django.utils import timezone
from django.utils.dateparse import parse_date, parse_datetime

from evaluator import ranking
from evaluator.protocol import SCORE_NAMES
from leaderboard import deadlines
from leaderboard.entries import (
    Entry,
    Scored,
    flat_scores,
    named,
    profile_of,
    published_entry,
    reason_told,
    scored_in,
    scores_in,
    submitted_entry,
)
from leaderboard.filters import Filters
from leaderboard.models import (
    Edition,
    Evaluation,
    Method,
    PublishedResult,
    Split,
    Status,
    Submission,
    User,
    Visibility,
    days,
)
from leaderboard.models.methods import MethodQuerySet
from leaderboard.order import PRIMARY, Place, in_ranks, key, listed

__all__ = ["Board", "Entry", "board", "everybodys", "flat_scores", "scores_in", "with_own"]

TEXT_COLUMNS = ("rank", "method", "team", "date")
SORTABLE = (*TEXT_COLUMNS, *SCORE_NAMES)
SORTS = (*SORTABLE, *(f"-{name}" for name in SORTABLE))
"""Every order that an address can ask for."""


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
class Board:
    """A ranked board: one split, one edition, one point in time. `entries` are those that fit the filters."""

    split: Split
    edition: Edition | None
    entries: tuple[Entry, ...]
    sort: str = "rank"
    at: datetime | None = None
    updated_at: datetime | None = None
    is_open: bool = field(default=False)
    deadline: str = ""  # in a sentence, where there is one
    filters: Filters = field(default_factory=Filters)
    n_in_all: int = 0  # rows before the filters
    n_submissions: int = 0  # those of them that are submissions
    n_left_behind: int = 0  # where there is none: those that former editions scored and this one does not


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
    filters: Filters | None = None,
) -> Board:
    """The board of a split in one edition (the published one unless named), as `viewer` may see it.

    With `at` the board as it stood then: the edition that was published, with what it had scored by then of
    what had been shown by then. Ranks are by published MiD among everything that everybody sees, whatever
    the filters; ties share a rank; a row without that value has none. Each method is represented by the best
    of its standing submissions; one whose submissions were all withdrawn leaves a row without values. Rows
    that only the viewer's own team sees carry the rank that they would have, and take nobody's place. Raises
    `UnknownColumn`.
    """
    require_column(sort)
    edition = edition or (edition_at(split, at) if at else split.published_edition)
    shown = everybodys(split=split, edition=edition, at=at)
    return arranged(
        with_own(shown, split=split, edition=edition, viewer=viewer, at=at),
        split=split,
        edition=edition,
        sort=sort,
        at=at,
        filters=filters,
    )


def require_column(sort: str) -> None:
    """Raise `UnknownColumn` for what no board can be sorted by."""
    if sort.removeprefix("-") not in SORTABLE:
        raise UnknownColumn(sort)


def arranged(
    entries: Sequence[Entry],
    *,
    split: Split,
    edition: Edition | None,
    sort: str = "rank",
    at: datetime | None = None,
    filters: Filters | None = None,
) -> Board:
    """A board of ranked rows: those that fit the filters, in the order of one column."""
    filters, now = filters or Filters(), timezone.now()
    n_submissions = sum(entry.kind == "submission" for entry in entries)
    dates = [entry.listed_at for entry in entries if entry.listed_at]
    if edition and edition.published_at:
        dates.append(edition.published_at)
    return Board(
        split=split,
        edition=edition,
        entries=tuple(listed([entry for entry in entries if filters.admits(entry)], by=sort)),
        sort=sort,
        at=at,
        updated_at=max(dates, default=None),
        is_open=deadlines.is_open(split, now=now),
        deadline=deadlines.sentence_of(split, now=now),
        filters=filters,
        n_in_all=len(entries),
        n_submissions=n_submissions,
        n_left_behind=0 if n_submissions or edition is None or at else _n_left_behind(edition),
    )


def _n_left_behind(edition: Edition) -> int:
    """Standing submissions of shown methods that another published edition of the split has scored."""
    scored = Evaluation.objects.filter(status=Status.SCORED, edition__published_at__isnull=False)
    return (
        Submission.objects.standing()
        .filter(split=edition.split_id, method__in=Method.objects.shown())
        .filter(pk__in=scored.exclude(edition=edition).values("submission"))
        .count()
    )


def edition_at(split: Split, at: datetime) -> Edition | None:
    """The edition that was the board at that time."""
    publication = (
        split.publications.filter(at__lte=at)
        .select_related("edition__ground_truth")
        .order_by("-at", "-pk")
        .first()
    )
    return publication.edition if publication else None


# --- what everybody sees ---------------------------------------------------------------------------------


def everybodys(
    *,
    split: Split,
    edition: Edition | None,
    at: datetime | None = None,
    supposed: Method | None = None,
) -> tuple[Entry, ...]:
    """The rows that everybody sees, ranked and marked, untouched by readers and private methods.

    `supposed` is a method with a visibility that it does not have yet: the rows as they would be then.
    """
    quoted = PublishedResult.objects.on_board(split, edition, at=at)
    entries = [published_entry(result) for result in quoted]
    if edition is not None:
        shown = Method.objects.shown(at=at)
        if supposed is not None:
            shown = shown | Method.objects.filter(pk=supposed.pk)
        rows = _best_of_each(shown, split=split, edition=edition, at=at, supposed=supposed)
        attempts = _attempts(shown, split=split, at=at, supposed=supposed)
        entries += [replace(row, n_attempts=attempts.of(row)) for row in rows]
    return in_ranks(entries)


def _best_of_each(
    methods: MethodQuerySet,
    *,
    split: Split,
    edition: Edition,
    at: datetime | None,
    supposed: Method | None = None,
) -> list[Entry]:
    """One row for each of these methods, without its rank: the best of its submissions, masked if need be."""
    rows = Evaluation.objects.filter(
        edition=edition, status=Status.SCORED, submission__method__in=methods
    ).select_related("submission__method__team")
    if at is not None:
        rows = rows.filter(_finished_by(at, method="submission__method"))
    # Before their scores, which are written with them; in an order of their own, so that bytes keep theirs.
    evaluations = list(rows.order_by("pk"))
    scored = scored_in(edition, methods=methods, has_ranges=at is None)
    unscorable = unscorable_in(edition, split=split)
    best: dict[UUID, tuple[Place, Entry]] = {}
    for evaluation in evaluations:
        submission = evaluation.submission
        if supposed is not None and submission.method_id == supposed.pk:
            submission.method = supposed
        method, withdrawn_at = submission.method, submission.withdrawn_at
        if at is not None and withdrawn_at is not None and withdrawn_at > method.known_until(at):
            withdrawn_at = None
        if withdrawn_at and not method.was_shown_before(withdrawn_at):
            continue  # nobody saw it: no stone for what was never there
        entry = submitted_entry(
            evaluation,
            scored.get(evaluation.pk) or Scored(),
            profile=profile_of(method, is_masked=method.is_masked),
            decimals=edition.decimals,
            withdrawn_at=withdrawn_at,
            unscorable=unscorable.get(evaluation.submission_id, ""),
        )
        place = key(entry.scores[PRIMARY], submission.submitted_at)
        rival = best.get(method.pk)
        if rival is None or place < rival[0]:
            best[method.pk] = place, entry
    return [entry for _, entry in best.values()]


def _finished_by(at: datetime, *, method: str) -> Q:
    """What had been decided by then, of anonymous methods by the end of that day."""
    is_masked = Q(**{f"{method}__visibility": Visibility.ANONYMOUS})
    return Q(finished_at__lte=at) | is_masked & Q(finished_at__lte=days.known_until(at, is_masked=True))


def unscorable_in(edition: Edition, *, split: Split) -> dict[UUID, str]:
    """Submissions that a former edition scored and the published one rejects: its manifest has other keys.

    By each the code of the reason.
    """
    if split.published_edition_id in {None, edition.pk}:
        return {}
    rejected = Evaluation.objects.filter(
        edition=split.published_edition_id,
        status=Status.REJECTED,
        submission__in=Evaluation.objects.filter(edition=edition, status=Status.SCORED).values("submission"),
    )
    return {pk: reason_told(problems) for pk, problems in rejected.values_list("submission", "problems")}


@dataclass(frozen=True)
class Attempts:
    """How many scored submissions each method has, and the public ones of each team together."""

    by_method: Mapping[UUID, int]
    by_team: Mapping[UUID, int]
    team_of: Mapping[UUID, UUID]

    def of(self, row: Entry) -> int:
        """What a row says: a named one of all that its team shows, an anonymous one of nothing but itself."""
        if row.method_id is None:
            return 0
        if row.visibility == Visibility.PUBLIC:
            return self.by_team.get(self.team_of[row.method_id], 0)
        return self.by_method.get(row.method_id, 0)


def _attempts(
    methods: MethodQuerySet, *, split: Split, at: datetime | None, supposed: Method | None = None
) -> Attempts:
    """Counted are submissions that were scored in a published edition: those that cost a slot for good."""
    scored = Evaluation.objects.filter(
        submission=OuterRef("pk"), status=Status.SCORED, edition__published_at__isnull=False
    )
    if at is not None:
        scored = scored.filter(_finished_by(at, method="submission__method"))
    rows = (
        Submission.objects.filter(Exists(scored), split=split, method__in=methods)
        .order_by()
        .values_list("method", "method__team", "method__visibility")
        .annotate(n=Count("pk"))
    )
    by_method, by_team = dict[UUID, int](), dict[UUID, int]()
    team_of: dict[UUID, UUID] = {}
    for method_id, team_id, visibility, n in rows:
        by_method[method_id] = n
        team_of[method_id] = team_id
        if supposed is not None and method_id == supposed.pk:
            visibility = supposed.visibility  # noqa: PLW2901 - as if it were
        if visibility == Visibility.PUBLIC:
            by_team[team_id] = by_team.get(team_id, 0) + n
    return Attempts(by_method=by_method, by_team=by_team, team_of=team_of)


# --- what a reader's own team sees beside ----------------------------------------------------------------


def with_own(
    shown: Sequence[Entry],
    *,
    split: Split,
    edition: Edition | None,
    viewer: User | AnonymousUser,
    at: datetime | None = None,
) -> tuple[Entry, ...]:
    """What everybody sees, for one reader: their team's rows marked and named, and its private ones added.

    A private row has the rank that it would take; the others keep theirs.
    """
    if not viewer.is_authenticated or edition is None:
        return tuple(shown)
    own = Method.objects.of(viewer).select_related("team")
    by_id = {method.pk: method for method in own}
    if not by_id:
        return tuple(shown)
    marked = [
        unmasked(entry, by_id[entry.method_id]) if entry.method_id in by_id else entry for entry in shown
    ]
    hidden = [pk for pk, method in by_id.items() if not method.was_shown(at=at)]
    if not hidden:
        return tuple(marked)
    return (*marked, *_private_rows(hidden, shown, split=split, edition=edition, at=at))


def unmasked(entry: Entry, method: Method) -> Entry:
    """The row as the method's own team reads it."""
    return replace(
        entry,
        **named(profile_of(method)),
        is_mine=True,
        pseudonym=method.pseudonym if method.visibility == Visibility.ANONYMOUS else "",
    )


def _private_rows(
    hidden: Collection[UUID],
    shown: Sequence[Entry],
    *,
    split: Split,
    edition: Edition,
    at: datetime | None,
) -> list[Entry]:
    methods = Method.objects.filter(pk__in=hidden)
    by_id = {method.pk: method for method in methods.select_related("team")}
    rows = _best_of_each(methods, split=split, edition=edition, at=at)
    attempts = _attempts(methods, split=split, at=at)
    public = [entry.scores[PRIMARY] for entry in shown]
    return [
        replace(
            unmasked(row, by_id[row.method_id]),
            visibility=Visibility.PRIVATE,
            pseudonym="",
            rank=ranking.rank([*public, row.scores[PRIMARY]])[-1],
            n_attempts=attempts.by_method.get(row.method_id, 0),
        )
        for row in rows
        if row.method_id is not None
    ]
