"""Intake of submissions: one file for one split, acknowledged only once it is durable."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, NamedTuple

import structlog
from django.conf import settings
from django.core.files.base import File
from django.db import transaction
from django.db.models import Q

from evaluator.predictions import documents
from evaluator.predictions.documents import EMPTY_MESSAGE
from evaluator.spelling import similar_name
from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, clean_text, shown_split
from leaderboard.methods import editing
from leaderboard.models import Edition, Method, SentFile, Split, Submission, Team, User
from leaderboard.ops import faults
from leaderboard.people import teams
from leaderboard.people.names import clean_name
from leaderboard.queue import lifecycle
from leaderboard.quotas import admissions, mailboxes, usage
from leaderboard.storage import files, orphans

log = structlog.get_logger(__name__)


@dataclass(frozen=True, kw_only=True)
class SubmissionRequest:
    """A file to submit; empty `details` of the method change nothing."""

    user: User
    split_name: str
    method_name: str
    upload: "File[bytes] | None"
    via: str
    now: datetime
    filename: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""
    commit: str = ""
    may_edit: bool = True

    def cleaned(self) -> "SubmissionRequest":
        """Return the request with clean texts and details. Raises `Refused`."""
        return replace(
            self,
            method_name=clean_name("method", self.method_name),
            details=editing.cleaned(self.details),
            filename=_clean_filename(self.filename),
            note=clean_text("note", self.note, limit=500, required=False),
            commit=clean_text("commit", self.commit, limit=64, required=False),
        )

    def changes_of(self, method: Method | None) -> dict[str, Any]:
        """Return the details that the request changes. Raises `Refused`."""
        if method is None:
            editing.require_hardware(self.details, method=None)
            return {}
        given = {name: value for name, value in self.details.items() if value not in (None, "")}
        changes = {name: value for name, value in given.items() if getattr(method, name) != value}
        if changes and not self.may_edit:
            raise _token_split(method, changes)
        editing.require_hardware(changes, method=method)
        return changes


@dataclass(frozen=True)
class Submitted:
    """The answer to a submission; `is_new` is False when the same bytes had come before.

    `notes` are sentences about a new submission that may be a slip.
    """

    submission: Submission
    is_new: bool
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FirstLook:
    """What a request would do: a clean request, its file, and the submission of the same bytes, if any."""

    request: SubmissionRequest
    file: files.StoredFile
    split: Split
    team: Team | None
    method: Method | None
    sent_before: Submission | None

    def notes(self) -> tuple[str, ...]:
        """Say whether the name or the bytes are probably those of another method of the team."""
        return tuple(note for note in (self._similar_name(), self._same_bytes()) if note)

    def _similar_name(self) -> str:
        if self.method is not None or self.team is None:
            return ""
        own = Method.objects.existing().filter(team=self.team).order_by("name")
        similar = similar_name(self.request.method_name, own.values_list("name", flat=True))
        return f"“{self.request.method_name}” is a new method; your team has “{similar}”." if similar else ""

    def _same_bytes(self) -> str:
        same = Submission.objects.active().filter(
            split=self.split, method__team=self.team, **_sent_file(self.file, self.split)._asdict()
        )
        other = same.exclude(method=self.method).select_related("method").order_by("submitted_at").first()
        if other is None:
            return ""
        return f"Your team submitted the same file to {self.split.title} before, as “{other.method.name}”."


def submit(request: SubmissionRequest) -> Submitted:
    """Take a prediction file. On return it is durable: bytes on the disk, rows committed, evaluation queued.

    The same bytes for the same split, method and manifest return the first submission, also once the split
    takes nothing more. Details that differ replace the method's; without `may_edit` they are refused. Raises
    `Refused` or `usage.QuotaExceeded`; nothing is kept then.
    """
    look = first_look(request)
    if look.sent_before is not None:
        return Submitted(submission=look.sent_before, is_new=False)
    request, file, split, upload = look.request, look.file, look.split, _checked(request.upload)
    notes = look.notes()
    files.save_predictions(upload, measured=file, now=request.now)
    with orphans.unless_refused(Refused, usage.QuotaExceeded, digest=file.digest), transaction.atomic():
        orphans.lock(file.digest)
        files.require_unchanged(upload, digest=file.digest)
        submitted = _record(request, file, split=split)
    if submitted.is_new:
        faults.clear(faults.UPLOADS)
        log.info(
            "submission_received",
            submission_id=str(submitted.submission.pk),
            split=split.pk,
            via=request.via,
            digest=file.digest,
            size_bytes=file.size_bytes,
        )
        return replace(submitted, notes=notes)
    return submitted


def first_look(request: SubmissionRequest) -> FirstLook:
    """Check a request and keep nothing. Raises as `submit`."""
    split = shown_split(request.split_name)
    if split.current_edition is None:
        _require_open(split, now=request.now)
    request = request.cleaned()
    file = files.measure(_checked(request.upload))
    team = teams.current_team_of(user=request.user)
    method, sent_before, _ = _answers(request, file, split=split, team=team)
    return FirstLook(
        request=request, file=file, split=split, team=team, method=method, sent_before=sent_before
    )


class _Answers(NamedTuple):
    method: Method | None
    sent_before: Submission | None
    changes: Mapping[str, Any]


def _answers(
    request: SubmissionRequest, file: files.StoredFile, *, split: Split, team: Team | None
) -> _Answers:
    """Check a file in this order: same bytes, opening, admission, quota, changes, name.

    Runs twice: before the bytes are written, to spare the disk, and under locks. Raises as `submit`.
    """
    method = Method.objects.existing().filter(team=team, name=request.method_name).first()
    sent_before = _sent_before(file, split=split, method=method) if method else None
    if sent_before is not None:
        return _Answers(method, sent_before, {})
    _require_open(split, now=request.now)
    admissions.require(team=team, split=split)
    usage.require(team=team, user=request.user, split=split, size_bytes=file.size_bytes, now=request.now)
    changes = request.changes_of(method)
    if method is None and team is not None:
        # Without the lock another request may be making this very method, which is no other name.
        editing.require_distinct_name(request.method_name, team=team, field="method", may_exist=True)
    return _Answers(method, None, changes)


def _record(request: SubmissionRequest, file: files.StoredFile, *, split: Split) -> Submitted:
    # From here on the board stays, so the file is queued in an edition with the manifest that its row names.
    split = Split.objects.select_related("current_edition__ground_truth").lock_shared(split.pk)
    team = _locked_team(request.user)
    method, sent_before, changes = _answers(request, file, split=split, team=team)
    if sent_before is not None:
        return Submitted(submission=sent_before, is_new=False)
    if method is None:
        method = Method.objects.create(
            team=team, name=request.method_name, created_at=request.now, **request.details
        )
    submission = Submission.objects.create(
        split=split,
        method=method,
        submitted_by=request.user,
        submitted_at=request.now,
        **_sent_file(file, split)._asdict(),
        size_bytes=file.size_bytes,
        via=request.via,
        filename=request.filename,
        note=request.note,
        commit=request.commit,
    )
    mailboxes.keep(user=request.user, now=request.now)
    _queue(submission, split=split)
    if changes:
        submission.method = editing.edit(method=method, changes=changes, actor=request.user)
    audit.record_of(submission, "submitted", actor=request.user)
    return Submitted(submission=submission, is_new=True)


def _locked_team(user: User) -> Team:
    usage.lock_accounts(user=user)
    team = teams.team_of(user=user)
    usage.lock(team=team)
    teams.require_member(team, user)
    return team


def _queue(submission: Submission, *, split: Split) -> None:
    """Queue for the published edition and those in preparation; the caller has locked the split."""
    editions = Edition.objects.filter(split=split)
    for edition in editions.in_preparation() | editions.filter(Q(pk=split.current_edition_id)):
        lifecycle.enqueue(submission=submission, edition=edition)


def _require_open(split: Split, *, now: datetime) -> None:
    refusal = admissions.refusal_for_all(split, now=now)
    if refusal is not None:
        raise refusal


def _token_split(method: Method, changes: Mapping[str, str]) -> Refused:
    first = next(iter(changes))
    return Refused(
        "token-split",
        f"The token is valid for one split only, and the field{'s' if len(changes) > 1 else ''} "
        f"{', '.join(map(repr, changes))} would change the method {method.name!r} on every split; expected "
        "the present value, no value, or a token for every split.",
        field=first,
    )


def _sent_before(file: files.StoredFile, *, split: Split, method: Method) -> Submission | None:
    names = _sent_file(file, split)._asdict()
    return Submission.objects.active().filter(split=split, method=method, **names).first()


def _sent_file(file: files.StoredFile, split: Split) -> SentFile:
    assert split.current_edition is not None  # noqa: S101 - for the type checker: the split takes files
    return SentFile(file.digest, split.current_edition.ground_truth.manifest_digest)


def _checked(upload: "File[bytes] | None") -> "File[bytes]":
    if upload is None:
        message = "No prediction file was sent; expected one in the field 'file'."
        raise Refused("no-file", message, field="file")
    if upload.size == 0:
        raise Refused("not-json", EMPTY_MESSAGE, field="file")
    if upload.size > settings.MAX_PREDICTIONS_BYTES:
        raise Refused("too-large", too_large(n_bytes=upload.size), field="file")
    return upload


def too_large(*, n_bytes: int) -> str:
    return documents.too_large(n_bytes=n_bytes, max_bytes=settings.MAX_PREDICTIONS_BYTES)


def _clean_filename(name: str) -> str:
    # It is shown, never used as a path.
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(c for c in last if c.isprintable())[:200]


def withdraw(*, submission: Submission, actor: User, now: datetime) -> bool:
    """Withdraw a submission for its team. Returns False if it had been withdrawn. Raises `Refused`."""
    if not submission.method.team.memberships.filter(user=actor).exists():
        raise Refused("not-yours", "Only the team that sent a submission can withdraw it.")
    with transaction.atomic():
        changed = Submission.objects.active().filter(pk=submission.pk).update(withdrawn_at=now)
        if not changed:
            return False
        lifecycle.cancel(submission=submission, actor=actor)
        audit.record_of(submission, "withdrawn", actor=actor)
        # Before looking who is private: whoever shows a method holds this until it is shown.
        board_versions.lock()
        if Method.objects.shown().filter(pk=submission.method_id).exists():
            board_versions.bump(submission.split_id)
    submission.withdrawn_at = now
    return True
