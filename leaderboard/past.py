"""Boards of the past, made of facts that change only when the board does.

What an edition's board showed at any moment follows from when its entries were scored, shown and withdrawn,
and from when rows of papers were added and replaced.
These facts are read once (`facts`), and the board of a moment is made of them without the database
(`everybodys`). `leaderboard/standings.py` says what a board of the past is, by reading it from the database;
what is made here is the same, row by row.
"""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from uuid import UUID

from django.db.models import Min

from evaluator.protocol import SCORE_NAMES
from leaderboard.entries import (
    Entry,
    Interval,
    Profile,
    named,
    profile_of,
    published_entry,
    score_name,
)
from leaderboard.models import Edition, Evaluation, Method, Score, Status, Visibility, days
from leaderboard.order import PRIMARY, Place, in_ranks, key
from leaderboard.standings import Attempts, unscorable_in

Values = list[float | None]

_NONE: Values = [None] * len(SCORE_NAMES)  # never changed: copied
_PLACE = {name: place for place, name in enumerate(SCORE_NAMES)}
_PRIMARY = _PLACE[PRIMARY]
# Of an evaluation and its submission, what a row says; reports and problems are long.
_COLUMNS = (
    "pk",
    "finished_at",
    "submission_id",
    "submission__method_id",
    "submission__submitted_at",
    "submission__withdrawn_at",
)


@dataclass(frozen=True)
class Shown:
    """A method that everybody sees, as everybody sees it now."""

    method_id: UUID
    shown_at: datetime
    visibility: str
    profile: Profile  # as everybody sees it
    team_id: UUID | None  # of a named one
    counted_at: tuple[datetime, ...]  # when each of its submissions to the split was scored first, in order

    @property
    def is_masked(self) -> bool:
        """Whether everybody sees it under a pseudonym."""
        return self.visibility == Visibility.ANONYMOUS

    def known_until(self, at: datetime) -> datetime:
        """Until when a board as of `at` knows what happened to it."""
        return days.known_until(at, is_masked=self.is_masked)


@dataclass(frozen=True)
class Run:
    """A submission as an edition scored it; the values and their ends in the order of `SCORE_NAMES`."""

    method: int  # its place among the methods
    submission_id: UUID
    evaluation_id: UUID
    submitted_at: datetime
    scored_at: datetime
    withdrawn_at: datetime | None
    unscorable: str
    scores: tuple[float | None, ...]
    low: tuple[float | None, ...]
    high: tuple[float | None, ...]


@dataclass(frozen=True)
class Quoted:
    """A row of a paper, and while it stood on the board."""

    entry: Entry
    added_at: datetime
    replaced_at: datetime | None

    def stood(self, at: datetime) -> bool:
        """Whether it stood on the board at that time."""
        return self.added_at <= at and (self.replaced_at is None or at < self.replaced_at)


@dataclass(frozen=True)
class Past:
    """All that everybody may know of an edition's boards at any time."""

    decimals: int  # the edition's
    quoted: tuple[Quoted, ...]  # the rows of papers
    methods: tuple[Shown, ...]
    runs: tuple[Run, ...]


# --- read from the database ------------------------------------------------------------------------------


def facts(edition: Edition) -> Past:
    """The facts of an edition that is or was the board, with its split and that one's published edition."""
    split = edition.split
    counted = _counted(split.pk)
    shown = Method.objects.shown().filter(pk__in=counted).select_related("team").order_by("pk")
    methods = tuple(_shown(method, counted[method.pk]) for method in shown)
    return Past(
        decimals=edition.decimals,
        quoted=_quoted(edition),
        methods=methods,
        runs=_runs(edition, {method.method_id: i for i, method in enumerate(methods)}),
    )


def _quoted(edition: Edition) -> tuple[Quoted, ...]:
    """The rows of papers that ever stood on the edition's board: none that came after it was the board."""
    ended_at = edition.ended_at(edition.split)
    found = []
    for result in edition.split.published_results.order_by("pk"):
        if ended_at is not None and result.added_at > ended_at:
            continue
        is_later = ended_at is not None and result.replaced_at is not None and result.replaced_at > ended_at
        replaced_at = None if is_later else result.replaced_at
        found.append(Quoted(published_entry(result), result.added_at, replaced_at))
    return tuple(found)


def _counted(split_id: str) -> dict[UUID, list[datetime]]:
    """Of each shown method, when its submissions were first scored in an edition that was ever published."""
    rows = Evaluation.objects.filter(
        status=Status.SCORED,
        edition__published_at__isnull=False,
        submission__split=split_id,
        submission__method__in=Method.objects.shown(),
    )
    found: dict[UUID, list[datetime]] = {}
    firsts = (
        rows.order_by().values_list("submission__method_id", "submission").annotate(at=Min("finished_at"))
    )
    for method_id, _, at in firsts:
        found.setdefault(method_id, []).append(at)
    return {method_id: sorted(moments) for method_id, moments in found.items()}


def _shown(method: Method, counted_at: list[datetime]) -> Shown:
    assert method.shown_at is not None  # noqa: S101 - for the type checker: a constraint says so
    is_masked = method.is_masked
    return Shown(
        method_id=method.pk,
        shown_at=method.shown_at,
        visibility=method.visibility,
        profile=profile_of(method, is_masked=is_masked),
        team_id=None if is_masked else method.team_id,
        counted_at=tuple(counted_at),
    )


def _runs(edition: Edition, places: Mapping[UUID, int]) -> tuple[Run, ...]:
    rows = Evaluation.objects.filter(
        edition=edition, status=Status.SCORED, submission__method__in=Method.objects.shown()
    )
    # Before their scores, which are written with them; in an order of their own, so that bytes keep theirs.
    evaluations = list(rows.order_by("pk").values_list(*_COLUMNS))
    scored = _scored(edition)
    unscorable = unscorable_in(edition, split=edition.split)
    found = []
    for pk, scored_at, submission_id, method_id, submitted_at, withdrawn_at in evaluations:
        values, low, high = scored.get(pk) or (_NONE, _NONE, _NONE)
        found.append(
            Run(
                method=places[method_id],
                submission_id=submission_id,
                evaluation_id=pk,
                submitted_at=submitted_at,
                scored_at=scored_at,
                withdrawn_at=withdrawn_at,
                unscorable=unscorable.get(submission_id, ""),
                scores=tuple(values),
                low=tuple(low),
                high=tuple(high),
            )
        )
    return tuple(found)


def _scored(edition: Edition) -> dict[UUID, tuple[Values, Values, Values]]:
    """The values of each evaluation of a shown method, and their lower and upper ends."""
    rows = Score.objects.filter(
        evaluation__edition=edition, evaluation__submission__method__in=Method.objects.shown()
    )
    found: dict[UUID, tuple[Values, Values, Values]] = {}
    columns = ("evaluation_id", "metric", "interval", "value", "low", "high")
    for pk, metric, interval, value, low, high in rows.values_list(*columns):
        known = found.get(pk)
        if known is None:
            known = found[pk] = list(_NONE), list(_NONE), list(_NONE)
        place = _PLACE[score_name(metric, interval)]
        known[0][place], known[1][place], known[2][place] = value, low, high
    return found


# --- made of the facts -----------------------------------------------------------------------------------


def everybodys(past: Past, *, at: datetime) -> tuple[Entry, ...]:
    """The rows that everybody saw at that time, ranked and marked, as everybody sees them now."""
    best: dict[int, tuple[Place, Run]] = {}
    for run in past.runs:
        method = past.methods[run.method]
        until = method.known_until(at)
        withdrawn_at = _withdrawn_at(run, until)
        # What nobody saw before it was withdrawn leaves no stone.
        if run.scored_at > until or method.shown_at > (withdrawn_at or until):
            continue
        value = None if withdrawn_at else run.scores[_PRIMARY]
        place = key(value, run.submitted_at)
        rival = best.get(run.method)
        if rival is None or place < rival[0]:
            best[run.method] = place, run
    attempts = _attempts(past, at)
    rows = [
        replace(_entry(run, past.methods[run.method], at), decimals=past.decimals) for _, run in best.values()
    ]
    quoted = [row.entry for row in past.quoted if row.stood(at)]
    return in_ranks([*quoted, *(replace(row, n_attempts=attempts.of(row)) for row in rows)])


def _withdrawn_at(run: Run, at: datetime) -> datetime | None:
    """When it was withdrawn, if it was by then."""
    return run.withdrawn_at if run.withdrawn_at is not None and run.withdrawn_at <= at else None


def _entry(run: Run, method: Shown, at: datetime) -> Entry:
    withdrawn_at = _withdrawn_at(run, method.known_until(at))
    ends = () if withdrawn_at else zip(SCORE_NAMES, run.low, run.high, strict=True)
    return Entry(
        kind="submission",
        **named(method.profile),
        scores=dict(zip(SCORE_NAMES, _NONE if withdrawn_at else run.scores, strict=True)),
        intervals={name: Interval(low, high) for name, low, high in ends if (low, high) != (None, None)},
        date=days.told(run.submitted_at, is_masked=method.is_masked),
        method_id=method.method_id,
        submission_id=run.submission_id,
        evaluation_id=run.evaluation_id,
        visibility=method.visibility,
        shown_at=days.told(method.shown_at, is_masked=method.is_masked),
        withdrawn_at=days.told_or_none(withdrawn_at, is_masked=method.is_masked),
        unscorable=run.unscorable,
    )


def _attempts(past: Past, at: datetime) -> Attempts:
    """What had been tried by then, of the methods that were shown by then."""
    by_method, by_team = dict[UUID, int](), dict[UUID, int]()
    team_of: dict[UUID, UUID] = {}
    for method in past.methods:
        until = method.known_until(at)
        if method.shown_at > until:
            continue
        n = by_method[method.method_id] = bisect_right(method.counted_at, until)
        if method.team_id is not None:
            team_of[method.method_id] = method.team_id
            by_team[method.team_id] = by_team.get(method.team_id, 0) + n
    return Attempts(by_method=by_method, by_team=by_team, team_of=team_of)
