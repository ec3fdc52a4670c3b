"""Deletion of a method without any score; it withdraws the submissions and frees the name."""

from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.methods.editing import require_team
from leaderboard.models import Evaluation, Method, Status, Submission, User, Visibility
from leaderboard.people import teams
from leaderboard.submissions import intake


def can_be_deleted(method: Method) -> bool:
    """Tell whether only its team has seen the method, and nothing of it was or can be scored."""
    if method.visibility != Visibility.PRIVATE or method.deleted_at is not None:
        return False
    return not evaluations_that_keep(method).exists()


def evaluations_that_keep(method: Method) -> QuerySet[Evaluation]:
    """Return what was or can be scored; a withdrawn score counts, too."""
    others = Evaluation.objects.exclude(status__in=[Status.REJECTED, Status.CANCELLED])
    return others.filter(submission__method=method)


def delete(*, method: Method, actor: User, now: datetime) -> None:
    """Delete an empty method for its team. Raises `Refused` for any other method or person."""
    with transaction.atomic():
        # Whoever submits holds the team as well, so that no file comes in between.
        teams.locked(method.team)
        row = Method.objects.select_for_update(no_key=True).select_related(None).get(pk=method.pk)
        require_team(row, actor)
        if not can_be_deleted(row):
            raise Refused(
                "not-empty",
                f"The method {row.name!r} cannot be deleted; expected a private method without a scored or "
                "waiting submission.",
            )
        for sent in Submission.objects.active().filter(method=row).select_related("method__team"):
            intake.withdraw(submission=sent, actor=actor, now=now)
        row.deleted_at = now
        row.save(update_fields=["deleted_at"])
        audit.record_of(row, "deleted", actor=actor, names={"name": row.name})
