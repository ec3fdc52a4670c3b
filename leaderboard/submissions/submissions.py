"""Submissions: one file for one split, acknowledged only once it can no longer be lost."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

import structlog
from django.conf import settings
from django.core.files.base import File
from django.db import IntegrityError, transaction
from django.db.models import Q

from leaderboard import (
    admissions,
    audit,
    boards,
    cleaning,
    deadlines,
    estimates,
    files,
    lifecycle,
    methods,
    quotas,
    teams,
    verdicts,
)
from leaderboard.entries import Interval, scored_of
from leaderboard.models import Evaluation, Method, SentFile, Split, Status, Submission, Team, User
from leaderboard.names import clean_name
from leaderboard.texts import Refused, clean_text, clean_url

log = structlog.get_logger(__name__)


class TooLarge(Refused):
    """The file is over the size limit."""


class TokenSplit(Refused):
    """The token is good for one split, and details of a method stand on every split."""


@dataclass(frozen=True)
class Submitted:
    """The answer to a submission; `is_new` is False when the same bytes had come before."""

    submission: Submission
    is_new: bool


def submit(
    *,
    user: User,
    split_name: str,
    method_name: str,
    upload: File | None,
    via: str,
    now: datetime,
    filename: str = "",
    description: str = "",
    paper_url: str = "",
    code_url: str = "",
    note: str = "",
    commit: str = "",
    may_edit: bool = True,
) -> Submitted:
    """Take a prediction file. On return it is durable: bytes on the disk, rows committed, evaluation queued.

    The same bytes again, for the same split, method and manifest, are answered with the first submission,
    cost nothing and change nothing. Once a correction has another manifest, the same bytes are another
    submission: their keys may mean other sequences. With a new file, details that differ from the method's
    own replace them, through `methods.edit`; without `may_edit` they are refused. Raises `Refused` or
    `quotas.QuotaExceeded` (nothing is kept then).
    """
    split = _open_split(split_name, now=now)
    name = clean_name("method", method_name)
    details = methods.MethodDetails(
        description=clean_text("description", description, limit=2000, required=False),
        paper_url=clean_url("paper_url", paper_url),
        code_url=clean_url("code_url", code_url),
    )
    note = clean_text("note", note, limit=500, required=False)
    commit = clean_text("commit", commit, limit=64, required=False)
    upload = _checked(upload)
    first = _before_the_quota(user=user, split=split, method_name=name, upload=upload, now=now)
    if first is None and not may_edit:
        first = _before_an_edit(user=user, split=split, method_name=name, upload=upload, details=details)
    if first is not None:
        return Submitted(submission=first, is_new=False)
    kept = files.keep_predictions(upload, now=now)
    refused = cleaning.unless_refused(Refused, quotas.QuotaExceeded, digest=kept.digest)
    with refused, transaction.atomic():
        cleaning.hold(kept.digest)
        files.keep_still(upload, digest=kept.digest)
        # Before the team: whoever founds a team has the audit trail from then on, and waits for nothing more.
        # From here on the board stays, so the file is queued in an edition with the manifest named below.
        split = Split.objects.lock_shared(split.pk)
        quotas.hold_before_founding(user=user)
        team = teams.team_of(user=user)
        quotas.hold(team=team)
        teams.require_member(team, user)
        admissions.require(team=team, split=split)
        method = _method(team=team, name=name, details=details, now=now)
        file = SentFile(kept.digest, _manifest_digest(split))
        standing = Submission.objects.standing().filter(split=split, method=method, **file._asdict())
        first = standing.first()
        if first is not None:
            return Submitted(submission=first, is_new=False)
        changes = details.changes_of(method)
        if changes and not may_edit:
            raise _token_split(method, changes)
        quotas.require(team=team, user=user, split=split, size_bytes=kept.size_bytes, now=now)
        try:
            with transaction.atomic():
                submission = Submission.objects.create(
                    split=split,
                    method=method,
                    submitted_by=user,
                    submitted_at=now,
                    via=via,
                    **file._asdict(),
                    size_bytes=kept.size_bytes,
                    filename=_clean_filename(filename),
                    note=note,
                    commit=commit,
                )
        except IntegrityError:
            # The same bytes came twice at once, and the other request was first.
            return Submitted(submission=standing.get(), is_new=False)
        _queue(submission, split=split)
        if changes:
            submission.method = methods.edit(method=method, changes=changes, actor=user)
        audit.record(verb="submitted", noun="Submission", noun_id=submission.pk, actor=user)
    log.info(
        "submission_received",
        submission_id=str(submission.pk),
        split=split.pk,
        via=via,
        digest=kept.digest,
        size_bytes=kept.size_bytes,
    )
    return Submitted(submission=submission, is_new=True)


def _queue(submission: Submission, *, split: Split) -> None:
    """Queue the submission for the published edition, and for any that is being prepared beside it.

    The caller holds the split.
    """
    in_preparation = Q(published_at=None, discarded_at=None)
    for edition in split.editions.filter(in_preparation | Q(pk=split.published_edition_id)):
        lifecycle.enqueue(submission=submission, edition=edition)


def _open_split(name: str, *, now: datetime) -> Split:
    # Looked up here and not there: not every text is one that a database can be asked for.
    splits = {split.name: split for split in Split.objects.select_related("published_edition__ground_truth")}
    split = splits.get(name)
    if split is None:
        known = ", ".join(splits)
        raise Refused(
            "unknown-split", f"There is no split {name[:80]!r}; expected one of {known}.", field="split"
        )
    refusal = deadlines.refusal_of(split, now=now)
    if refusal is not None:
        raise refusal
    return split


def _before_the_quota(
    *, user: User, split: Split, method_name: str, upload: "File[bytes]", now: datetime
) -> Submission | None:
    """Where no slot is open, the submission that had these bytes before. None: go on, and ask again.

    So that a file that cannot be taken is not written first. Raises `Refused` or `quotas.QuotaExceeded`.
    """
    team = teams.present_team_of(user=user)
    admissions.require(team=team, split=split)
    named = Method.objects.filter(team=team, name=method_name)
    try:
        quotas.require(team=team, user=user, split=split, size_bytes=upload.size, now=now)
    except quotas.QuotaExceeded:
        file = SentFile(files.measure(upload).digest, _manifest_digest(split))
        first = Submission.objects.standing().filter(split=split, method__in=named, **file._asdict()).first()
        if first is None:
            raise
        return first
    if team is not None and not named.exists():
        methods.require_own_look(method_name, team=team, field="method")
    return None


def _before_an_edit(
    *, user: User, split: Split, method_name: str, upload: "File[bytes]", details: methods.MethodDetails
) -> Submission | None:
    """Of who may not change the method, the submission that had these bytes before. None: there is no change.

    So that a file that cannot be taken is not written first. Raises `Refused`.
    """
    method = Method.objects.filter(team=teams.present_team_of(user=user), name=method_name).first()
    changes = details.changes_of(method) if method is not None else {}
    if method is None or not changes:
        return None
    file = SentFile(files.measure(upload).digest, _manifest_digest(split))
    first = Submission.objects.standing().filter(split=split, method=method, **file._asdict()).first()
    if first is None:
        raise _token_split(method, changes)
    return first


def _token_split(method: Method, changes: Mapping[str, str]) -> TokenSplit:
    first = next(iter(changes))
    return TokenSplit(
        "token-split",
        f"The token is good for one split alone, and the field{'s' if len(changes) > 1 else ''} "
        f"{', '.join(map(repr, changes))} would change the method {method.name!r} on every split; expected "
        "what stands there, nothing, or a token for every split.",
        field=first,
    )


def _manifest_digest(split: Split) -> str:
    """The manifest that is public now. The split takes submissions, so it has a published edition."""
    assert split.published_edition is not None  # noqa: S101 - for the type checker: the caller has looked
    return split.published_edition.ground_truth.manifest_digest


def _checked(upload: "File[bytes] | None") -> "File[bytes]":
    if upload is None:
        raise Refused(
            "no-file", "No prediction file was sent; expected one in the field 'file'.", field="file"
        )
    if upload.size > settings.MAX_PREDICTIONS_BYTES:
        raise TooLarge("too-large", too_large(found_bytes=upload.size), field="file")
    return upload


def too_large(*, found_bytes: int) -> str:
    """The sentence for a file over the limit."""
    return (
        f"The file has {found_bytes:,} bytes; expected at most {settings.MAX_PREDICTIONS_BYTES:,} "
        f"({settings.MAX_PREDICTIONS_BYTES / 1e6:g} MB)."
    )


def _method(*, team: Team, name: str, details: methods.MethodDetails, now: datetime) -> Method:
    """The team's method of that name, as it is; a new one is made with these details, and is private.

    Raises `Refused` for a name that looks like another one of the team's.
    """
    method = Method.objects.filter(team=team, name=name).first()
    if method is None:
        teams.locked(team)
        method = Method.objects.filter(team=team, name=name).first()
    if method is None:
        methods.require_own_look(name, team=team, field="method")
        return Method.objects.create(team=team, name=name, created_at=now, **details.given)
    return method


def _clean_filename(name: str) -> str:
    """The last part of a file's name with printable characters only; it is shown, never used as a path."""
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(c for c in last if c.isprintable())[:200]


def withdraw(*, submission: Submission, actor: User, now: datetime) -> bool:
    """Withdraw a submission for its team: what waits is cancelled, what was published leaves a tombstone.

    Returns False if it had been withdrawn before. Raises `Refused` for somebody outside the team.
    """
    if not submission.method.team.memberships.filter(user=actor).exists():
        raise Refused("not-yours", "Only the team that sent a submission can withdraw it.")
    with transaction.atomic():
        changed = Submission.objects.standing().filter(pk=submission.pk).update(withdrawn_at=now)
        if not changed:
            return False
        lifecycle.cancel(submission=submission, actor=actor)
        # Before looking who is private: whoever shows a method holds this until it is shown.
        audit.hold(actor)
        if Method.objects.shown().filter(pk=submission.method_id).exists():
            boards.changed(submission.split_id)
        audit.record(verb="withdrawn", noun="Submission", noun_id=submission.pk, actor=actor)
    submission.withdrawn_at = now
    return True


# --- how it goes -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Progress:
    """What its team sees of a submission."""

    state: str
    state_label: str
    received_at: datetime
    queued_at: datetime | None = None
    started_at: datetime | None = None
    finished_at: datetime | None = None
    n_ahead: int | None = None
    estimate_s: float | None = None
    scores: Mapping[str, float | None] | None = None
    intervals: Mapping[str, Interval] = field(default_factory=dict)  # by score name, where computed
    counts: Mapping[str, int] = field(default_factory=dict)
    truncated: Mapping[str, int] = field(default_factory=dict)
    n_out_of_range: int | None = None
    warnings: list[dict[str, str]] = field(default_factory=list)  # of a scored file: code and message
    problems: list[dict[str, str]] = field(default_factory=list)
    n_problems: int = 0
    fault_is_ours: bool = False
    sentence: str = ""
    is_final: bool = False
    edition_number: int | None = None
    protocol: str = ""
    decimals: int = 2  # of its values
    kept_in: int | None = None  # rejected here: the number of the last published edition that scored it


def evaluation_of(submission: Submission) -> Evaluation:
    """The evaluation that speaks for a submission: in the published edition, else in the latest.

    Of an edition in preparation only where there is no other.
    """
    published = submission.split.published_edition_id
    # Sorted here and not by the database, so that a list of submissions can fetch its evaluations at once.
    evaluations = sorted(submission.evaluations.all(), key=_place_of_edition)
    return next((e for e in evaluations if e.edition_id == published), evaluations[-1])


def _place_of_edition(evaluation: Evaluation) -> tuple[bool, int]:
    return evaluation.edition.published_at is not None, evaluation.edition.number


def progress(submission: Submission) -> Progress:
    """How far a submission is, and what came of it."""
    evaluation = evaluation_of(submission)
    report = evaluation.report or {}
    place = estimates.place_of(evaluation)
    scored = scored_of(evaluation.scores.all()) if evaluation.status == Status.SCORED else None
    return Progress(
        state=evaluation.status,
        state_label=Status(evaluation.status).label,
        received_at=submission.submitted_at,
        queued_at=evaluation.queued_at,
        started_at=evaluation.started_at,
        finished_at=evaluation.finished_at,
        n_ahead=place.n_ahead if place else None,
        estimate_s=place.estimate_s if place else None,
        scores=scored.values if scored else None,
        intervals=scored.intervals if scored else {},
        counts=report.get("counts", {}),
        truncated=report.get("truncated", {}),
        n_out_of_range=report.get("n_out_of_range"),
        warnings=report.get("warnings", []),
        problems=evaluation.problems,
        n_problems=evaluation.n_problems,
        fault_is_ours=evaluation.status == Status.SYSTEM_ERROR,
        sentence=verdicts.sentence_of(evaluation),
        is_final=evaluation.is_final,
        edition_number=evaluation.edition.number,
        decimals=evaluation.edition.decimals,
        protocol=evaluation.edition.protocol,
        kept_in=evaluation.kept_in,
    )
