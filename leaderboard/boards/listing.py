"""Boards: the rows of a split in one edition, submissions and published results together, at any time."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db.models import Count, Exists, OuterRef, Q, QuerySet
from django.utils import timezone
from django.utils.dateparse import parse_date, parse_datetime

from evaluator.metrics import registry
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, Protocol, get_protocol, known_names
from leaderboard.boards.filters import Filters
from leaderboard.boards.rows import (
    NO_RANGES,
    Entry,
    Scored,
    SortKey,
    in_ranks,
    key,
    listed,
    named,
    profile_of,
    public_reason,
    quoted_entry,
    ranges_in,
    scored_in,
    submitted_entry,
)
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
from leaderboard.quotas import admissions

TEXT_COLUMNS = ("rank", "method", "team", "date")
SORTABLE = (*TEXT_COLUMNS, *known_names())
"""Every order that an address can ask for."""


class UnknownColumn(ValueError):
    field = "sort"

    def __init__(self, column: str, *, known: Sequence[str]) -> None:
        self.on_page = (
            f"This board has no “{column[:60]}” column, so it is sorted by rank. "
            "Select a column heading to sort."
        )
        super().__init__(
            f"The board cannot be sorted by {column!r}; expected one of {', '.join(known)}, "
            "with a leading '-' for the reverse."
        )


class BadTime(ValueError):
    """The text is no point in time."""

    field = "at"

    def __init__(self, text: str) -> None:
        super().__init__(
            f"{text[:60]!r} is not a date or a time; expected one such as 2026-11-20 or 2026-11-20T18:00:00Z."
        )


@dataclass(frozen=True)
class Board:
    """A ranked board. `entries` are those that fit the filters."""

    split: Split
    edition: Edition | None
    entries: tuple[Entry, ...]
    sort: str = "rank"
    at: datetime | None = None
    updated_at: datetime | None = None  # the end of the day of an anonymous row
    is_open: bool = field(default=False)
    label: str = ""  # whether it is open, where that is worth a word
    filters: Filters = field(default_factory=Filters)
    unfiltered: tuple[Entry, ...] = ()  # all rows, before the filters, in no order
    n_submissions: int = 0  # those of them that are submissions
    n_left_behind: int = 0  # where there is none: those that earlier editions scored and this one does not

    @property
    def n_in_all(self) -> int:
        return len(self.unfiltered)

    @property
    def rules(self) -> Protocol:
        return rules_of(self.edition)

    @property
    def floor(self) -> dict[str, float | None] | None:
        """Return the scores of the ground truth itself in the protocol's order; None until computed."""
        floor = self.edition.floor if self.edition else None
        return {name: floor[name] for name in self.rules.score_names if name in floor} if floor else None


def rules_of(edition: Edition | None) -> Protocol:
    """Return the protocol of an edition, or the default one before there is any."""
    return edition.rules if edition else get_protocol(DEFAULT_PROTOCOL)


def parse_time(text: str) -> datetime:
    """A point in time from a date (its end, in UTC) or an ISO time. Raises `BadTime`."""
    try:
        # The date first: an ISO time may leave out its time of day, and would then mean the day's beginning.
        moment = parse_date(text) or parse_datetime(text)
        if moment is None:
            raise BadTime(text)
        if not isinstance(moment, datetime):
            return datetime.combine(moment, time.max, tzinfo=UTC)
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise BadTime(text) from None


def board(
    *,
    split: Split,
    edition: Edition | None = None,
    viewer: User | AnonymousUser,
    sort: str = "rank",
    at: datetime | None = None,
    filters: Filters | None = None,
    read: "Callable[..., tuple[Entry, ...]] | None" = None,
) -> Board:
    """Return the board of a split in one edition (default: the published one), as `viewer` may see it.

    `at` is a time in the past; visibility is always as of now. Ranks are by the protocol's first metric among
    all public rows, whatever the filters; ties share a rank. A method is represented by the best of its
    active submissions. Rows that only the viewer's team sees carry the rank that they would have. `read`
    replaces `public_rows`. Raises `UnknownColumn`.
    """
    edition = edition or (edition_at(split, at) if at else split.current_edition)
    require_column(sort, rules=rules_of(edition))
    shown = (read or public_rows)(split=split, edition=edition, at=at)
    entries = with_own(shown, split=split, edition=edition, viewer=viewer, at=at)
    filters, now = filters or Filters(), timezone.now()
    n_submissions = sum(entry.kind == "submission" for entry in entries)
    dates = [
        days.known_until(entry.listed_at, is_masked=entry.visibility == Visibility.ANONYMOUS)
        for entry in entries
        if entry.listed_at
    ]
    if edition and edition.published_at:
        dates.append(edition.published_at)
    return Board(
        split=split,
        edition=edition,
        entries=tuple(listed([entry for entry in entries if filters.admits(entry)], by=sort)),
        sort=sort,
        at=at,
        updated_at=max(dates, default=None),
        is_open=admissions.is_open(split, now=now),
        label=admissions.label_of(split, now=now),
        filters=filters,
        unfiltered=entries,
        n_submissions=n_submissions,
        n_left_behind=0 if n_submissions or edition is None or at else _n_left_behind(edition),
    )


def require_column(sort: str, *, rules: Protocol | None = None) -> None:
    """Raise `UnknownColumn` for what a board of this protocol cannot be sorted by."""
    known = (*TEXT_COLUMNS, *(rules.score_names if rules else known_names()))
    if sort.removeprefix("-") not in known:
        raise UnknownColumn(sort, known=known)


def _n_left_behind(edition: Edition) -> int:
    scored = Evaluation.objects.filter(status=Status.SCORED, edition__published_at__isnull=False)
    return (
        Submission.objects.active()
        .filter(split=edition.split_id, method__in=Method.objects.shown())
        .filter(pk__in=scored.exclude(edition=edition).values("submission"))
        .count()
    )


def edition_at(split: Split, at: datetime) -> Edition | None:
    """Return the edition that was published at that time."""
    publication = (
        split.publications.filter(at__lte=at)
        .select_related("edition__ground_truth")
        .order_by("-at", "-pk")
        .first()
    )
    return publication.edition if publication else None


# --- what everybody sees ---------------------------------------------------------------------------------


def public_rows(
    *,
    split: Split,
    edition: Edition | None,
    at: datetime | None = None,
    assuming_visible: Method | None = None,
) -> tuple[Entry, ...]:
    """Return the rows that everybody sees, ranked and marked.

    `assuming_visible` is a method with a visibility that it does not have yet, for a preview.
    """
    quoted = PublishedResult.objects.on_board(split, edition, at=at)
    entries = [quoted_entry(result, rules=rules_of(edition)) for result in quoted]
    if edition is not None:
        shown = Method.objects.shown(at=at)
        if assuming_visible is not None:
            shown = shown | Method.objects.filter(pk=assuming_visible.pk)
        rows = _best_of_each(shown, split=split, edition=edition, at=at, assuming_visible=assuming_visible)
        attempts = _attempts(shown, split=split, at=at, assuming_visible=assuming_visible)
        entries += [replace(row, n_attempts=attempts.get(row.method_id, 0)) for row in rows]
    return in_ranks(entries)


def _best_of_each(
    methods: MethodQuerySet,
    *,
    split: Split,
    edition: Edition,
    at: datetime | None,
    assuming_visible: Method | None = None,
) -> list[Entry]:
    """Return one row without rank for each method: its best submission, masked if need be."""
    scored_rows = Evaluation.objects.filter(
        edition=edition, status=Status.SCORED, submission__method__in=methods, submission__hidden_at=None
    )
    # No row says anything of reports and problems, which are long.
    rows = scored_rows.select_related("submission__method__team").defer("report", "problems")
    if at is not None:
        rows = rows.filter(_finished_by(at, method="submission__method"))
    unscorable = unscorable_in(edition, split=split)
    best: dict[UUID, tuple[SortKey, Entry]] = {}
    for evaluation, scored in _with_scores(rows, edition=edition, has_ranges=at is None):
        submission = evaluation.submission
        if assuming_visible is not None and submission.method_id == assuming_visible.pk:
            submission.method = assuming_visible
        method, withdrawn_at = submission.method, submission.withdrawn_at
        if at is not None and withdrawn_at is not None and withdrawn_at > method.known_until(at):
            withdrawn_at = None
        if withdrawn_at and not method.was_shown_before(withdrawn_at):
            continue  # it was never public: no tombstone row
        entry = submitted_entry(
            evaluation,
            scored,
            profile=profile_of(method, is_masked=method.is_masked),
            decimals=edition.decimals,
            withdrawn_at=withdrawn_at,
            unscorable=unscorable.get(evaluation.submission_id, ""),
        )
        sort_key = key(entry.value, submission.submitted_at)
        rival = best.get(method.pk)
        if rival is None or sort_key < rival[0]:
            best[method.pk] = sort_key, entry
    return [entry for _, entry in best.values()]


def _with_scores(
    rows: "QuerySet[Evaluation]", *, edition: Edition, has_ranges: bool
) -> Iterator[tuple[Evaluation, Scored]]:
    # In an order of their own, so that bytes keep theirs; before their scores, which are written with them.
    evaluations = list(rows.order_by("pk"))
    scored = scored_in(
        edition,
        evaluations=[row.pk for row in evaluations],
        ranges=ranges_in(edition) if has_ranges else NO_RANGES,
    )
    for row in evaluations:
        yield row, scored[row.pk]


def _finished_by(at: datetime, *, method: str) -> Q:
    # Anonymous methods count from the end of the day: its exact time could give them away.
    is_masked = Q(**{f"{method}__visibility": Visibility.ANONYMOUS})
    return Q(finished_at__lte=at) | is_masked & Q(finished_at__lte=days.known_until(at, is_masked=True))


def unscorable_in(edition: Edition, *, split: Split) -> dict[UUID, str]:
    """Return submissions that an earlier edition scored and the published one rejects, with their codes."""
    if split.current_edition_id in {None, edition.pk}:
        return {}
    rejected = Evaluation.objects.filter(
        edition=split.current_edition_id,
        status=Status.REJECTED,
        submission__in=Evaluation.objects.filter(edition=edition, status=Status.SCORED).values("submission"),
    )
    return {pk: public_reason(problems) for pk, problems in rejected.values_list("submission", "problems")}


def _attempts(
    methods: MethodQuerySet,
    *,
    split: Split,
    at: datetime | None,
    assuming_visible: Method | None = None,
    of_teams: bool = True,
) -> Mapping[UUID | None, int]:
    """Count the submissions scored in a published edition, by method.

    A public method counts all its team's shown ones with `of_teams`, any other method its own.
    """
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
    teller_of: dict[UUID | None, UUID] = {}
    counts = Counter[UUID]()
    for method_id, team_id, visibility, n in rows:
        if assuming_visible is not None and method_id == assuming_visible.pk:
            visibility = assuming_visible.visibility  # noqa: PLW2901 - as if it were
        teller_of[method_id] = team_id if of_teams and visibility == Visibility.PUBLIC else method_id
        counts[teller_of[method_id]] += n
    return {method_id: counts[teller] for method_id, teller in teller_of.items()}


# --- what a reader's own team sees beside ----------------------------------------------------------------


def with_own(
    shown: Sequence[Entry],
    *,
    split: Split,
    edition: Edition | None,
    viewer: User | AnonymousUser,
    at: datetime | None = None,
) -> tuple[Entry, ...]:
    """Name the rows of a reader's team, and add its private ones with the rank that they would have."""
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
    attempts = _attempts(methods, split=split, at=at, of_teams=False)
    public = [entry.value for entry in shown]
    return [
        replace(
            unmasked(row, by_id[row.method_id]),
            visibility=Visibility.PRIVATE,
            pseudonym="",
            rank=registry.rank([*public, row.value])[-1],
            n_attempts=attempts.get(row.method_id, 0),
        )
        for row in rows
        if row.method_id is not None
    ]
