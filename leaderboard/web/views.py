"""The pages' doors: each view calls one verb and hands what it says to a template."""

from typing import Any, cast
from uuid import UUID

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.db.models import Prefetch
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from leaderboard import editions, methods, quotas, standings
from leaderboard import submissions as verbs
from leaderboard.models import Edition, Evaluation, Method, Split, Submission, User
from leaderboard.web import api_reference as api
from leaderboard.web import edition_tables, reference, tables
from leaderboard.web.forms import SubmissionForm
from leaderboard.web.progress import shown

HOME_SPLIT = "test"
PER_PAGE = 50
# htmx takes this as "do not ask again".
STOP_POLLING = 286


@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """The board that papers quote."""
    return board(request, HOME_SPLIT)


@require_safe
def board(request: HttpRequest, split: str) -> HttpResponse:
    """A split's board, in the order that `?sort=` asks for, now or as it stood `?at=` a time."""
    found = get_object_or_404(Split.objects.select_related("published_edition__ground_truth"), pk=split)
    return draw_board(request, "board.html", split=found, news=edition_tables.news(found))


def draw_board(
    request: HttpRequest, template: str, *, split: Split, edition: Edition | None = None, **more: Any
) -> HttpResponse:
    """A board in the order, and as of the time, that the address asks for; an edition's has no other time."""
    names = ("sort",) if edition else ("sort", "at")
    query = {name: request.GET[name] for name in names if name in request.GET}
    try:
        at = standings.parse_moment(query["at"]) if "at" in query else None
        at = at if at and at < timezone.now() else None  # what has not come yet is as it is now
        shown = standings.board(
            split=split, edition=edition, viewer=request.user, sort=query.get("sort", "rank"), at=at
        )
    except (standings.UnknownColumn, standings.BadMoment) as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=400)
    table = edition_tables.with_reasons(tables.board_table(shown, query=query), shown)
    return render(request, template, {"board": shown, "table": table, **more})


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def submit(request: HttpRequest) -> HttpResponse:
    """Take a prediction file."""
    user = cast("User", request.user)
    form = SubmissionForm.for_user(user, request)
    if request.method == "POST" and form.is_valid():
        try:
            submitted = verbs.submit(user=user, now=timezone.now(), **form.submission())
        except (verbs.Refused, quotas.QuotaExceeded) as refusal:
            form.refuse(refusal)
        else:
            if not submitted.is_new:
                messages.info(request, "This very file had been submitted before; this is what came of it.")
            return redirect("submission", submitted.submission.pk)
    return render(request, "submit.html", {"form": form}, status=422 if form.errors else 200)


@login_required
@never_cache
@require_safe
def submissions(request: HttpRequest) -> HttpResponse:
    """What the reader's own team has sent."""
    evaluations = Evaluation.objects.select_related("edition").prefetch_related("scores")
    sent = (
        Submission.objects.filter(method__team__memberships__user=cast("User", request.user))
        .select_related("method", "split", "submitted_by")
        .prefetch_related(Prefetch("evaluations", evaluations))
    )
    page = Paginator(sent, PER_PAGE).get_page(request.GET.get("page"))
    return render(request, "submissions.html", {"page": page, "rows": tables.submission_rows(page)})


@login_required
@never_cache
@require_safe
def submission(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """One submission: its state, then its result or its problems."""
    return render(request, "submission.html", _evaluation(request, submission_id))


@login_required
@never_cache
@require_safe
def submission_state(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """What a waiting page asks for: nothing new, the new state, or at the end not to ask any more."""
    context = _evaluation(request, submission_id)
    if request.GET.get("seen") == context["shown"].seen:
        return HttpResponse(status=204)
    status = STOP_POLLING if context["progress"].is_final else 200
    return render(request, "submission_state.html", context | {"is_fragment": True}, status=status)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def withdraw(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """Say what withdrawing does, and do it; for the submission's own team."""
    user = cast("User", request.user)
    own = Submission.objects.filter(method__team__memberships__user=user)
    found = get_object_or_404(own.select_related("method__team", "split"), pk=submission_id)
    if request.method == "POST" and verbs.withdraw(submission=found, actor=user, now=timezone.now()):
        messages.success(request, "The submission is withdrawn.")
    if request.method == "POST" or found.withdrawn_at:
        return redirect("submission", found.pk)
    return render(request, "withdraw.html", {"submission": found})


@require_safe
def method(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """A method: what it is, and what it achieved on each split."""
    rows = Method.objects.visible_to(request.user).select_related("team").distinct()
    found = get_object_or_404(rows, pk=method_id)
    results = methods.results(method=found, viewer=request.user)
    return render(request, "method.html", {"method": found, "results": tables.method_results(results)})


@require_safe
def docs(request: HttpRequest) -> HttpResponse:
    """How to submit, the file's format, the errors, the API."""
    return render(request, "docs.html", reference.docs())


@require_safe
def api_reference(request: HttpRequest) -> HttpResponse:
    """Every path, parameter and shape of the API."""
    return render(request, "api_reference.html", {"api": api.reference()})


def _evaluation(request: HttpRequest, submission_id: UUID) -> dict[str, Any]:
    rows = Submission.objects.visible_to(request.user).select_related("method__team", "split", "submitted_by")
    found = get_object_or_404(rows, pk=submission_id)
    progress = verbs.progress(found)
    return {
        "submission": found,
        "progress": progress,
        "shown": shown(progress),
        "rescored": edition_tables.rescored_notice(editions.rescored(found)),
        "is_mine": found.method.team.memberships.filter(user=cast("User", request.user)).exists(),
    }
