"""Submissions: one file for one split, acknowledged only once it can no longer be lost."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import structlog
from django.conf import settings
from django.core.files.base import File
from django.db import transaction
from django.db.models import Q

from evaluator.predictions.documents import EMPTY_MESSAGE
from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, clean_text, shown_split
from leaderboard.methods import editing
from leaderboard.models import Method, SentFile, Split, Submission, Team, User
from leaderboard.people import teams
from leaderboard.people.names import clean_name
from leaderboard.queue import lifecycle
from leaderboard.quotas import admissions, limits
from leaderboard.storage import files, orphans

log = structlog.get_logger(__name__)


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
    method_details: Mapping[str, object] | None = None,
    note: str = "",
    commit: str = "",
    may_edit: bool = True,
) -> Submitted:
    """Take a prediction file. On return it is durable: bytes on the disk, rows committed, evaluation queued.

    The same bytes again, for the same split, method and manifest, are answered with the first submission and
    change nothing. Details that differ from the method's own replace them; without `may_edit` they are
    refused. Raises `Refused` or `limits.QuotaExceeded` (nothing is kept then).
    """
    split = _open_split(split_name, now=now)
    asked = _Asked(
        user=user,
        split=split,
        method_name=clean_name("method", method_name),
        details=editing.cleaned(
            {
                "description": description,
                "paper_url": paper_url,
                "code_url": code_url,
                **(method_details or {}),
            }
        ),
        row={
            "via": via,
            "filename": _clean_filename(filename),
            "note": clean_text("note", note, limit=500, required=False),
            "commit": clean_text("commit", commit, limit=64, required=False),
        },
        upload=_checked(upload),
        now=now,
        may_edit=may_edit,
    )
    file = files.measure(asked.upload)
    first = _admit(asked, file)
    if first is not None:
        return Submitted(submission=first, is_new=False)
    files.save_predictions(asked.upload, measured=file, now=now)
    with orphans.unless_refused(Refused, limits.QuotaExceeded, digest=file.digest), transaction.atomic():
        submitted = _record(asked, file)
    if submitted.is_new:
        log.info(
            "submission_received",
            submission_id=str(submitted.submission.pk),
            split=split.pk,
            via=via,
            digest=file.digest,
            size_bytes=file.size_bytes,
        )
    return submitted


@dataclass(frozen=True)
class _Asked:
    """A request to submit, its texts clean."""

    user: User
    split: Split
    method_name: str
    details: Mapping[str, Any]  # of the method; an empty one says nothing, and changes nothing
    row: Mapping[str, str]  # what stands in the submission's row as it came
    upload: "File[bytes]"
    now: datetime
    may_edit: bool

    def changes_of(self, method: Method) -> dict[str, Any]:
        """What the request changes of the method. Raises `Refused`."""
        given = {name: value for name, value in self.details.items() if value not in (None, "")}
        changes = {name: value for name, value in given.items() if getattr(method, name) != value}
        if changes and not self.may_edit:
            raise _token_split(method, changes)
        editing.require_hardware(changes, method=method)
        return changes


def _admit(asked: _Asked, file: files.StoredFile) -> Submission | None:
    """Refuse what cannot be taken, before its bytes are written; `_record` decides under locks.

    Returns the submission that had the same bytes before. Raises `Refused` or `limits.QuotaExceeded`.
    """
    team = teams.current_team_of(user=asked.user)
    admissions.require(team=team, split=asked.split)
    method = Method.objects.existing().filter(team=team, name=asked.method_name).first()
    first = _sent_before(file, split=asked.split, method=method) if method else None
    if first is not None:
        return first
    limits.require(team=team, user=asked.user, split=asked.split, size_bytes=file.size_bytes, now=asked.now)
    if method is not None:
        asked.changes_of(method)
    else:
        editing.require_hardware(asked.details, method=None)
        if team is not None:
            editing.require_distinct_name(asked.method_name, team=team, field="method", may_exist=True)
    return None


def _record(asked: _Asked, file: files.StoredFile) -> Submitted:
    """Write the rows of a stored file and queue it. Raises `Refused` or `limits.QuotaExceeded`."""
    orphans.lock(file.digest)
    files.require_unchanged(asked.upload, digest=file.digest)
    # From here on the board stays, so the file is queued in an edition with the manifest that its row names.
    split = Split.objects.select_related("published_edition__ground_truth").lock_shared(asked.split.pk)
    team = _held_team(asked.user)
    admissions.require(team=team, split=split)
    method = _method(asked, team=team)
    first = _sent_before(file, split=split, method=method)
    if first is not None:
        return Submitted(submission=first, is_new=False)
    changes = asked.changes_of(method)
    limits.require(team=team, user=asked.user, split=split, size_bytes=file.size_bytes, now=asked.now)
    submission = Submission.objects.create(
        split=split,
        method=method,
        submitted_by=asked.user,
        submitted_at=asked.now,
        **_sent_file(file, split)._asdict(),
        size_bytes=file.size_bytes,
        **asked.row,
    )
    _queue(submission, split=split)
    if changes:
        submission.method = editing.edit(method=method, changes=changes, actor=asked.user)
    audit.record(verb="submitted", noun="Submission", noun_id=submission.pk, actor=asked.user)
    return Submitted(submission=submission, is_new=True)


def _held_team(user: User) -> Team:
    """The person's team, new if there is none, locked until the transaction ends."""
    limits.hold_accounts(user=user)
    team = teams.team_of(user=user)
    limits.lock(team=team)
    teams.require_member(team, user)
    return team


def _queue(submission: Submission, *, split: Split) -> None:
    """Queue the submission for the published edition and any draft; the caller has locked the split."""
    in_preparation = Q(published_at=None, discarded_at=None)
    for edition in split.editions.filter(in_preparation | Q(pk=split.published_edition_id)):
        lifecycle.enqueue(submission=submission, edition=edition)


def _open_split(name: str, *, now: datetime) -> Split:
    split = shown_split(name)
    refusal = admissions.refusal_for_all(split, now=now)
    if refusal is not None:
        raise refusal
    return split


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
    """The standing submission of the same bytes under the manifest that is public now."""
    names = _sent_file(file, split)._asdict()
    return Submission.objects.standing().filter(split=split, method=method, **names).first()


def _sent_file(file: files.StoredFile, split: Split) -> SentFile:
    assert split.published_edition is not None  # noqa: S101 - for the type checker: the split takes files
    return SentFile(file.digest, split.published_edition.ground_truth.manifest_digest)


def _checked(upload: "File[bytes] | None") -> "File[bytes]":
    if upload is None:
        message = "No prediction file was sent; expected one in the field 'file'."
        raise Refused("no-file", message, field="file")
    if upload.size == 0:
        raise Refused("not-json", EMPTY_MESSAGE, field="file")
    if upload.size > settings.MAX_PREDICTIONS_BYTES:
        raise Refused("too-large", too_large(found_bytes=upload.size), field="file")
    return upload


def too_large(*, found_bytes: int) -> str:
    return (
        f"The file has {found_bytes:,} bytes; expected at most {settings.MAX_PREDICTIONS_BYTES:,} "
        f"({settings.MAX_PREDICTIONS_BYTES / 1e6:g} MB)."
    )


def _method(asked: _Asked, *, team: Team) -> Method:
    """The team's method of that name, made if there is none, in a locked team. Raises `Refused`."""
    method = Method.objects.existing().filter(team=team, name=asked.method_name).first()
    if method is None:
        editing.require_distinct_name(asked.method_name, team=team, field="method")
        method = Method.objects.create(
            team=team, name=asked.method_name, created_at=asked.now, **asked.details
        )
    return method


def _clean_filename(name: str) -> str:
    """The last part of a file's name with printable characters only; it is shown, never used as a path."""
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(c for c in last if c.isprintable())[:200]


def withdraw(*, submission: Submission, actor: User, now: datetime) -> bool:
    """Withdraw a submission for its team. Returns False if it had been withdrawn. Raises `Refused`."""
    if not submission.method.team.memberships.filter(user=actor).exists():
        raise Refused("not-yours", "Only the team that sent a submission can withdraw it.")
    with transaction.atomic():
        changed = Submission.objects.standing().filter(pk=submission.pk).update(withdrawn_at=now)
        if not changed:
            return False
        lifecycle.cancel(submission=submission, actor=actor)
        audit.record(verb="withdrawn", noun="Submission", noun_id=submission.pk, actor=actor)
        # Before looking who is private: whoever shows a method holds this until it is shown.
        board_versions.lock()
        if Method.objects.shown().filter(pk=submission.method_id).exists():
            board_versions.bump(submission.split_id)
    submission.withdrawn_at = now
    return True
