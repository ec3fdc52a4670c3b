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
from django.utils.functional import SimpleLazyObject
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from leaderboard import editions, methods, outcomes, quotas, snapshots
from leaderboard import submissions as verbs
from leaderboard.models import Edition, Evaluation, Method, Split, Status, Submission, User
from leaderboard.submissions import Progress
from leaderboard.web import api_reference as api
from leaderboard.web import (
    board_query,
    edition_tables,
    export_views,
    method_tables,
    outcome_tables,
    reference,
    result_tables,
    tables,
)
from leaderboard.web.board_tools import tools
from leaderboard.web.context import split_or_404, splits_of
from leaderboard.web.forms import SubmissionForm
from leaderboard.web.progress import Shown, shown

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
    found = split_or_404(request, split)
    # Asked for only by a page that tells it: a board of the past does not.
    news = SimpleLazyObject(lambda: edition_tables.news(found))
    return draw_board(request, "board.html", split=found, news=news)


def draw_board(
    request: HttpRequest, template: str, *, split: Split, edition: Edition | None = None, **more: Any
) -> HttpResponse:
    """A board as its address asks for it; an edition's has no other time."""
    try:
        query = board_query.parse(request.GET, now=timezone.now(), has_time=edition is None)
    except board_query.FAULTS as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=400)
    shown = snapshots.board(
        split=split,
        edition=edition,
        viewer=request.user,
        sort=query.sort,
        at=query.at,
        filters=query.filters,
    )
    table = edition_tables.with_reasons(tables.board_table(shown, query=query), shown)
    context = {
        "board": shown,
        "table": table,
        "tools": tools(shown, query),
        "exports": export_views.offers(shown, edition, query),
    }
    return render(request, template, context | more)


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
    return render(request, "submissions.html", {"page": page, "rows": result_tables.submission_rows(page)})


@login_required
@never_cache
@require_safe
def submission(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """One submission: its state, then its result or its problems."""
    found, progress, now_shown = _looked_at(request, submission_id)
    return render(request, "submission.html", _outcome(request, found, progress) | {"shown": now_shown})


@login_required
@never_cache
@require_safe
def submission_state(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """What a waiting page asks for: nothing new, the new state, or at the end not to ask any more.

    The end is the result with its intervals, or without them where none are about to come.
    """
    found, progress, now_shown = _looked_at(request, submission_id)
    if request.GET.get("seen") == now_shown.seen:
        return HttpResponse(status=204)
    context = _outcome(request, found, progress) | {"shown": now_shown, "is_fragment": True}
    status = 200 if now_shown.is_moving else STOP_POLLING
    return render(request, "submission_state.html", context, status=status)


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
    rows = Method.objects.visible_to(request.user).select_related("team")
    found = get_object_or_404(rows, pk=method_id)
    results = methods.results(method=found, viewer=request.user, splits=splits_of(request))
    profile = methods.profile(method=found, viewer=request.user)
    context = {
        "profile": profile,
        "details": method_tables.detail_words(profile.details),
        "visibility": found.visibility,
        "is_named": found.is_named_for(request.user),
        "is_mine": Method.objects.of(request.user).filter(pk=found.pk).exists(),
        "method_id": found.pk,
        "results": result_tables.method_results(results),
        **export_views.of_method(results),
    }
    return render(request, "method.html", context)


@require_safe
def docs(request: HttpRequest) -> HttpResponse:
    """How to submit, the file's format, the errors, the API."""
    return render(request, "docs.html", reference.docs())


@require_safe
def api_reference(request: HttpRequest) -> HttpResponse:
    """Every path, parameter and shape of the API."""
    return render(request, "api_reference.html", {"api": api.reference()})


def _looked_at(request: HttpRequest, submission_id: UUID) -> tuple[Submission, Progress, Shown]:
    """A submission that the reader may see and its line of state: all that a page asks for while it waits."""
    evaluations = Evaluation.objects.select_related("edition__ground_truth").prefetch_related("scores")
    rows = (
        Submission.objects.visible_to(request.user)
        .select_related("method__team", "split", "submitted_by")
        .prefetch_related(Prefetch("evaluations", evaluations))
    )
    found = get_object_or_404(rows, pk=submission_id)
    progress = verbs.progress(found)
    awaits = outcomes.awaits_intervals(found, progress, now=timezone.now())
    return found, progress, shown(progress, awaits_intervals=awaits)


def _outcome(request: HttpRequest, found: Submission, progress: Progress) -> dict[str, Any]:
    """What came of it, for the templates."""
    now = timezone.now()
    is_mine = found.method.team.memberships.filter(user=cast("User", request.user)).exists()
    rescored = edition_tables.rescored_notice(editions.rescored(found))
    quota = None
    if progress.state == Status.REJECTED and rescored is None:
        quota = quotas.state(team=found.method.team, user=found.submitted_by, split=found.split, now=now)
    return {
        "submission": found,
        "progress": progress,
        "result": outcome_tables.outcome_table(
            found,
            progress,
            place=outcomes.place_of(found, progress),
            interval_note=outcomes.why_no_intervals(found, progress, now=now),
            is_mine=is_mine,
        ),
        "cost": outcome_tables.rejected_sentence(quota),
        "rescored": rescored,
        "is_mine": is_mine,
    }
