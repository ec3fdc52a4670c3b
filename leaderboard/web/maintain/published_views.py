"""Published results, for maintainers: those on the boards, and a form to add a paper's."""

from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect
from django.utils import timezone

from evaluator.metrics.protocol import known_metrics
from evaluator.metrics.registry import Metric
from leaderboard.editions import splits
from leaderboard.models import PublishedResult
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
)
from leaderboard.web.maintain.published_forms import PaperForm, RemovalForm, RowForm, example


@maintainers_form
def remove(request: HttpRequest, split: str, slug: str) -> HttpResponse:
    row = get_object_or_404(PublishedResult, split=split, slug=slug, replaced_at=None)
    form = RemovalForm.asked(request)
    if form.is_valid():
        with form.refusals():
            splits.remove_published(
                split_name=split,
                slug=slug,
                now=timezone.now(),
                actor=maintainer_of(request),
                **form.cleaned_data,
            )
            messages.success(request, f"{row.method_name} was removed from {row.split.title}.")
            return redirect("maintain_published")
    return form_page(request, "maintain/published_remove.html", form, row=row)


@maintainers_form
def published(request: HttpRequest) -> HttpResponse:
    """Show the rows, and a form for one row and one for a document; the button says which was sent."""
    is_row = request.POST.get("step") == "row"
    sent = (request.POST, request.FILES) if request.method == "POST" else (None, None)
    row_form = RowForm(sent[0] if is_row else None, prefix="row")
    form: RowForm | PaperForm = PaperForm(*((None, None) if is_row else sent))
    context = {
        "row_form": row_form,
        "document_form": form,
        "example": example(),
        **_by_paper(),
        "opened": request.GET.get("form", ""),
    }
    form = row_form if is_row else form
    if form.is_valid():
        with form.refusals():
            done = splits.import_published(
                document=form.document(),
                now=timezone.now(),
                is_replacing=form.cleaned_data["is_replacing"],
                actor=maintainer_of(request),
            )
            words = (f"{len(names)} {outcome}" for outcome, names in vars(done).items() if names)
            messages.success(request, f"Rows: {', '.join(words) or 'none'}.")
            return redirect("maintain_published")
    return form_page(request, "maintain/published.html", form, **context)


def _by_paper() -> dict[str, Any]:
    """Return the rows on the boards by split and paper, with the overall scores that any of them has."""
    rows = list(splits.quoted())
    metrics = [each for name, each in known_metrics().items() if any(name in row.scores for row in rows)]
    papers: dict[tuple[str, ...], list[tuple[PublishedResult, list[tuple[Metric, str]]]]] = {}
    for row in rows:
        paper = (row.split_id, row.source_url, row.source_title, row.source_table, str(row.year))
        papers.setdefault(paper, []).append(
            (row, [(each, _words(row.scores.get(each.name))) for each in metrics])
        )
    return {"papers": list(papers.values()), "metrics": metrics}


def _words(value: float | None) -> str:
    return "–" if value is None else str(value)
