"""The queue for maintainers, and retries."""

from typing import Any

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.views.decorators.http import require_POST, require_safe

from evaluator.counting import counted
from leaderboard.models import Evaluation, Split
from leaderboard.queue import lifecycle
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_views import maintainer_of, maintainers_only
from leaderboard.web.maintain.queue_tables import STATES, queue_table


def _splits() -> list[tuple[str, str]]:
    return [("", "all"), *Split.objects.values_list("pk", "title")]


class QueueFilter(SiteForm):
    state = forms.ChoiceField(
        required=False,
        choices=[("", "all"), *((name, state.heading) for name, state in STATES.items())],
        error_messages={"invalid_choice": f"There is no such state; expected one of {', '.join(STATES)}."},
    )
    split = forms.ChoiceField(
        required=False,
        choices=_splits,
        error_messages={"invalid_choice": "There is no such split; expected one of those listed."},
    )


class RetryForm(forms.Form):
    evaluation = forms.ModelMultipleChoiceField(
        queryset=Evaluation.objects.defer("report", "problems"),
        error_messages={
            "required": "No evaluation was chosen; expected evaluations with a system error.",
            "invalid_choice": "There is no evaluation %(value)s; expected evaluations with a system error.",
        },
    )


@maintainers_only
@require_safe
def queue(request: HttpRequest) -> HttpResponse:
    return _page(request)


@maintainers_only
@require_safe
def queue_state(request: HttpRequest) -> HttpResponse:
    """Answer an open page: nothing new, or the present queue."""
    asked = QueueFilter(request.GET)
    if not asked.is_valid():
        return HttpResponse(status=400)
    context = _context(request, asked)
    if request.GET.get("seen") == context["shown"]["seen"]:
        return HttpResponse(status=204)
    return render(request, "maintain/queue_state.html", context)


@maintainers_only
@require_POST
def retry(request: HttpRequest) -> HttpResponse:
    form = RetryForm(request.POST)
    if not form.is_valid():
        return _page(request, status=422, refusals=form.errors["evaluation"])
    n_retried = 0
    for evaluation in form.cleaned_data["evaluation"]:
        try:
            lifecycle.retry(evaluation=evaluation, actor=maintainer_of(request), reason="from the queue")
            n_retried += 1
        except lifecycle.LostRace as race:
            messages.warning(request, f"{str(race).capitalize()}.")
    if n_retried:
        messages.success(request, f"{counted(n_retried, 'evaluation')} queued again.")
    return redirect(_path("maintain_queue", request.GET.urlencode()))


def _page(request: HttpRequest, *, status: int = 200, **more: Any) -> HttpResponse:
    asked = QueueFilter(request.GET)
    if not asked.is_valid():
        return render(request, "maintain/queue.html", {"form": asked}, status=400)
    return render(request, "maintain/queue.html", {**_context(request, asked), **more}, status=status)


def _context(request: HttpRequest, asked: QueueFilter) -> dict[str, Any]:
    table = queue_table(**asked.cleaned_data, number=request.GET.get("page"))
    number = table["sections"][0]["page"].number if asked.cleaned_data["state"] else 1
    of_split = asked.query(state="")
    page_query = asked.query(page=number if number > 1 else "")
    return {
        "form": asked,
        "shown": table,
        "query": asked.query(),
        "and_split": f"&{of_split}" if of_split else "",
        "page_query": page_query,
        "paths": {
            "page": _path("maintain_queue", page_query),
            "state": _path("maintain_queue_state", page_query),
            "retry": _path("maintain_retry", page_query),
        },
    }


def _path(view: str, query: str) -> str:
    return f"{reverse(view)}?{query}" if query else reverse(view)
