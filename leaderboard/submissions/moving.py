"""A submission under the wrong method is moved to the right one, by its team, while no other team sees it."""

from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing
from leaderboard.models import Method, Submission, User, Visibility
from leaderboard.people import teams


def targets(submission: Submission) -> QuerySet[Method]:
    """Return the methods to which its team may move a submission; none if it stays where it is."""
    if _why_it_stays(submission) is not None:
        return Method.objects.none()
    own = Method.objects.existing().filter(team=submission.method.team_id, visibility=Visibility.PRIVATE)
    return own.exclude(pk=submission.method_id).order_by("name")


def move(*, submission: Submission, method_name: str, actor: User, now: datetime) -> Submission:
    """Move a submission to another method of its team, by name or id. Its slot stays used.

    Receipts keep the former name. Both methods have to be private: what others may see or have seen is not
    arranged afterwards. Raises `Refused`.
    """
    if not editing.is_of(submission.method, actor):
        raise Refused("not-yours", "Only the team that sent a submission can move it.")
    name = editing.method_name_of(user=actor, text=method_name)
    with transaction.atomic():
        # As for whoever shows a method: its team first, then the methods, then the file.
        (team,) = teams.locked(submission.method.team)
        teams.require_member(team, actor)
        methods = Method.objects.existing().select_for_update(no_key=True).filter(team=team).order_by("pk")
        by_name = {method.name: method for method in methods}
        row = Submission.objects.select_for_update(no_key=True, of=("self",)).get(pk=submission.pk)
        target = by_name.get(name)
        if target is None:
            raise Refused(
                "unknown-method",
                f"Your team has no method {name[:80]!r}; expected the name or id of one.",
                field="method",
            )
        refusal = _why_it_stays(row) or _why_not_to(target, row)
        if refusal is not None:
            raise refusal
        details = {"from": str(row.method_id), "to": str(target.pk), "at": f"{now:%Y-%m-%dT%H:%M:%SZ}"}
        if row.method_id != target.pk:
            row.method = target
            row.save(update_fields=["method"])
            audit.record_of(row, "moved", actor=actor, details=details)
    return row


def _why_it_stays(submission: Submission) -> Refused | None:
    method = submission.method
    if submission.withdrawn_at is not None:
        return Refused("not-movable", "The submission is withdrawn; expected one that is not.")
    if submission.hidden_at is not None:
        return Refused("not-movable", "A maintainer has taken the submission off the boards, so it stays.")
    if method.visibility != Visibility.PRIVATE:
        state = method.get_visibility_display()
        return Refused("not-movable", f"The method {method.name!r} is {state}; expected a private one.")
    return None


def _why_not_to(target: Method, submission: Submission) -> Refused | None:
    if target.visibility != Visibility.PRIVATE:
        state = target.get_visibility_display()
        sentence = f"The method {target.name!r} is {state}; expected a private one."
        return Refused("not-movable", sentence, field="method")
    same = Submission.objects.active().filter(
        split=submission.split_id, method=target, **submission.sent_file._asdict()
    )
    if same.exclude(pk=submission.pk).exists():
        sentence = f"The method {target.name!r} has the same file already; expected a method without it."
        return Refused("same-file", sentence, field="method")
    return None
