"""Pages of submissions: form, list, one submission, analysis, receipt, withdrawal."""

from contextlib import closing
from typing import Any, cast
from uuid import UUID

from django.contrib import messages
from django.core.paginator import Paginator
from django.db.models import Prefetch
from django.http import (
    Http404,
    HttpRequest,
    HttpResponse,
    HttpResponseBase,
    HttpResponseNotModified,
    JsonResponse,
)
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_safe

from evaluator.predictions import writing
from leaderboard.boards import results
from leaderboard.boards.snapshots import splits_of
from leaderboard.editions import history
from leaderboard.http_caching import is_known
from leaderboard.models import Evaluation, Status, Submission, User, Visibility
from leaderboard.quotas import usage
from leaderboard.statistics import analyses
from leaderboard.storage import manifests
from leaderboard.submissions import intake, moving, outcomes, receipts, search
from leaderboard.submissions.progress import Progress, progress_of
from leaderboard.web.boards import edition_tables
from leaderboard.web.charts import analysis_charts
from leaderboard.web.decorators import own_form, own_page
from leaderboard.web.forms import ConfirmForm
from leaderboard.web.lookups import split_or_404
from leaderboard.web.methods import result_tables
from leaderboard.web.submissions import outcome_tables
from leaderboard.web.submissions.forms import MoveForm, SearchForm, SubmissionForm
from leaderboard.web.submissions.status_line import StateLine, state_line

PER_PAGE = 50
# htmx takes this as "do not ask again".
STOP_POLLING = 286


@own_form
def submit(request: HttpRequest) -> HttpResponse:
    user = cast("User", request.user)
    with closing(SubmissionForm(user, request)) as form:
        submitted = _submitted(form) if request.method == "POST" and form.is_valid() else None
        if submitted is not None:
            if not submitted.is_new:
                messages.info(request, "You already submitted this file. Here is its result.")
            return _taken(request, submitted.submission)
        is_sent = not form.errors and form.question is None
        return render(request, "submissions/submit.html", {"form": form}, status=200 if is_sent else 422)


def _submitted(form: SubmissionForm) -> intake.Submitted | None:
    """Submit the file of a valid form, unless something is asked first or it is refused."""
    asked_for = form.submission_request(now=timezone.now())
    try:
        submitted = None if form.asks(asked_for) else intake.submit(asked_for)
    except (intake.Refused, usage.QuotaExceeded) as refusal:
        form.refuse(refusal)
        return None
    if submitted is not None:
        form.forget_kept()
    return submitted


def _taken(request: HttpRequest, taken: Submission) -> HttpResponse:
    """Redirect to the submission; a script gets its address as JSON."""
    if "application/json" in request.headers.get("Accept", ""):
        return JsonResponse({"page": reverse("submission", args=[taken.pk])}, status=201)
    return redirect("submission", taken.pk)


@require_safe
def template(request: HttpRequest, split: str) -> HttpResponseBase:
    """Answer a file with the natural keys of all sequences and no value, to be filled in."""
    edition = split_or_404(request, split).current_edition
    if edition is None:
        raise Http404
    tag = f'"natural-template-{edition.ground_truth.manifest_digest}"'
    if is_known(request, tag):
        return HttpResponseNotModified(headers={"ETag": tag})
    return HttpResponse(
        writing.template(manifests.load(edition.ground_truth.manifest_digest)),
        content_type="application/json",
        headers={"ETag": tag, "Content-Disposition": f'attachment; filename="tsttc-{split}-template.json"'},
    )


@own_page
def submission_list(request: HttpRequest) -> HttpResponse:
    sent = search.of_teams(cast("User", request.user))
    form = SearchForm.of(request)
    page = Paginator(search.matching(sent, **form.wanted()), PER_PAGE).get_page(request.GET.get("page"))
    boards = results.own_rows(viewer=cast("User", request.user), splits=splits_of(request)) if page else []
    context = {
        "page": page,
        "table": result_tables.submission_table(page),
        "form": form,
        "bests": [result_tables.best_of_team(board) for board in boards],
        "comparable": {entry.submission_id for board in boards for entry in board.own},
    }
    return render(request, "submissions/submissions.html", context)


@own_page
def submission(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    row, progress, now_shown = _looked_at(request, submission_id)
    return render(
        request, "submissions/submission.html", _outcome(request, row, progress) | {"shown": now_shown}
    )


@own_page
def submission_state(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """Answer a waiting page: nothing new, the new state, or at the end to stop polling."""
    row, progress, now_shown = _looked_at(request, submission_id)
    if request.GET.get("seen") == now_shown.seen:
        return HttpResponse(status=204)
    context = _outcome(request, row, progress) | {"shown": now_shown, "is_fragment": True}
    status = 200 if now_shown.is_moving else STOP_POLLING
    return render(request, "submissions/state.html", context, status=status)


@own_form
def withdraw(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    user = cast("User", request.user)
    own = Submission.objects.filter(method__team__memberships__user=user)
    row = get_object_or_404(own.select_related("method__team", "split"), pk=submission_id)
    before = progress_of(row)
    if not outcomes.can_be_withdrawn(row):
        return redirect("submission", row.pk)
    form = ConfirmForm.asked(request)
    if form.is_valid():
        if intake.withdraw(submission=row, actor=user, now=timezone.now()):
            done = "withdrawn" if before.is_final else "cancelled"
            messages.success(request, f"The submission is {done}.")
        return redirect("submission", row.pk)
    position = outcomes.board_position_of(row, before)
    others = Submission.objects.active().filter(method=row.method_id, split=row.split_id).exclude(pk=row.pk)
    context = {
        "submission": row,
        "is_waiting": not before.is_final,
        "is_failed": before.fault_is_ours,
        "is_best": position is not None and position.rank is not None,
        "is_only": not others.filter(evaluations__status=Status.SCORED).exists(),
    }
    status = 422 if form.errors else 200
    return render(request, "submissions/withdraw.html", {"form": form, **context}, status=status)


@own_form
def move(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    user = cast("User", request.user)
    own = Submission.objects.of(user).select_related("method__team", "split")
    row = get_object_or_404(own, pk=submission_id)
    form = MoveForm.asked(request, methods=moving.targets(row))
    if form.is_valid():
        with form.refusals():
            moved = moving.move(
                submission=row, method_name=form.cleaned_data["method"], actor=user, now=timezone.now()
            )
            messages.success(request, f"The submission is now one of {moved.method.name}.")
            return redirect("submission", row.pk)
    status = 422 if form.errors else 200
    return render(request, "submissions/move.html", {"form": form, "submission": row}, status=status)


def _looked_at(request: HttpRequest, submission_id: UUID) -> tuple[Submission, Progress, StateLine]:
    evaluations = Evaluation.objects.select_related("edition__ground_truth").prefetch_related("scores")
    rows = (
        Submission.objects.visible_to(request.user)
        .select_related("method__team", "split", "submitted_by")
        .prefetch_related(Prefetch("evaluations", evaluations))
    )
    row = get_object_or_404(rows, pk=submission_id)
    progress = progress_of(row)
    awaits = outcomes.awaits_intervals(row, progress, now=timezone.now())
    shown = state_line(progress, awaits_intervals=awaits, withdrawn_at=row.withdrawn_at)
    return row, progress, shown


def _outcome(request: HttpRequest, row: Submission, progress: Progress) -> dict[str, Any]:
    now = timezone.now()
    is_mine = row.method.team.memberships.filter(user=cast("User", request.user)).exists()
    rescored = edition_tables.rescored_notice(history.rescored(row))
    quota = None
    if progress.state == Status.REJECTED and rescored is None:
        quota = usage.state(team=row.method.team, user=row.submitted_by, split=row.split, now=now)
    return {
        "submission": row,
        "progress": progress,
        "result": outcome_tables.outcome_table(
            row,
            progress,
            board_position=outcomes.board_position_of(row, progress),
            interval_note=outcomes.why_no_intervals(row, progress, now=now),
            is_mine=is_mine,
        ),
        "cost": outcome_tables.rejected_sentence(quota),
        "rescored": rescored,
        "is_mine": is_mine,
        "can_be_withdrawn": is_mine and outcomes.can_be_withdrawn(row),
        "can_be_moved": is_mine and moving.targets(row).exists(),
        "can_be_published": is_mine
        and row.withdrawn_at is None
        and row.method.visibility != Visibility.PUBLIC,
    }


@own_page
def analysis(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    rows = Submission.objects.visible_to(request.user).select_related("method", "split__current_edition")
    row = get_object_or_404(rows, pk=submission_id, split__is_hidden=False)
    progress = progress_of(row)
    if progress.is_final and progress.state != Status.SCORED:
        raise Http404("This submission has no score.")
    closer = analyses.for_submission(submission=row, viewer=request.user)
    references = analyses.reference_curves(split=row.split, besides=row.method) if closer else []
    tables = analysis_charts.error_analysis_tables(closer, references) if closer else None
    return render(
        request, "submissions/analysis.html", {"submission": row, "tables": tables, "closer": closer}
    )


@require_safe
@cache_control(public=True, max_age=3600)
def receipt_keys(request: HttpRequest) -> HttpResponse:
    """Answer the public keys of receipts as a JSON Web Key Set."""
    return JsonResponse(receipts.public_keys(), content_type="application/jwk-set+json")


@own_page
def receipt(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """Download the receipt of a score, as its team."""
    rows = Submission.objects.of(cast("User", request.user))
    row = get_object_or_404(rows.select_related("method__team", "split"), pk=submission_id)
    try:
        document = receipts.receipt(submission=row)
    except intake.Refused as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=409)
    response = HttpResponse(document, content_type=receipts.MEDIA_TYPE)
    response["Content-Disposition"] = f'attachment; filename="tsttc-receipt-{row.pk}.jwt"'
    return response
