"""Search among submissions: by text, split, state and method, in the database."""

from uuid import UUID

from django.db.models import Case, F, OuterRef, Prefetch, Q, QuerySet, Subquery, When

from leaderboard.models import Evaluation, Status, Submission, User

WITHDRAWN = "WITHDRAWN"
STATES = (*((str(each.value), str(each.label)) for each in Status), (WITHDRAWN, "withdrawn"))
"""What a submission can be asked for by: the status of the evaluation that speaks for it, or withdrawn."""


def of_teams(user: User) -> "QuerySet[Submission]":
    """Return the submissions of a person's teams, with what a list of them shows."""
    evaluations = Evaluation.objects.select_related("edition").prefetch_related("scores")
    return (
        Submission.objects.of(user)
        .select_related("method", "split", "submitted_by")
        .prefetch_related(Prefetch("evaluations", evaluations))
    )


def matching(
    rows: "QuerySet[Submission]",
    *,
    text: str = "",
    split: str = "",
    state: str = "",
    method: UUID | None = None,
) -> "QuerySet[Submission]":
    """Filter submissions by all that is given."""
    if text:
        named = Q(method__name__icontains=text) | Q(filename__icontains=text) | Q(note__icontains=text)
        rows = rows.filter(named)
    if split:
        rows = rows.filter(split=split)
    if method is not None:
        rows = rows.filter(method=method)
    if state == WITHDRAWN:
        return rows.filter(withdrawn_at__isnull=False)
    if state:
        # The evaluation that speaks for a submission, by the rule of `progress.evaluation_of`.
        is_current = Case(When(edition=F("submission__split__current_edition"), then=1), default=0)
        is_published = Case(When(edition__published_at=None, then=0), default=1)
        speaking = (
            Evaluation.objects.filter(submission=OuterRef("pk"))
            .annotate(is_current=is_current, is_published=is_published)
            .order_by("-is_current", "-is_published", "-edition__number")
        )
        rows = rows.annotate(speaking=Subquery(speaking.values("status")[:1])).filter(speaking=state)
    return rows
