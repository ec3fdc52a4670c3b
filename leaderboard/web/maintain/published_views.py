"""Published results, for maintainers: those on the boards, and a form to add a paper's."""

from typing import Any

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect
from django.utils import timezone

from evaluator.metrics.protocol import known_metrics
from leaderboard.editions import papers, splits
from leaderboard.editions.papers import BadDocument
from leaderboard.errors.refusals import Refused
from leaderboard.models import PublishedResult
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_forms import reason_field
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
)


class PaperForm(SiteForm):
    file = forms.FileField(
        label="Document",
        help_text="JSON with source, columns, methods and results.",
        widget=forms.FileInput(attrs={"accept": ".json,application/json"}),
        error_messages={
            "required": "No document was sent; expected a JSON file.",
            "empty": "The document is empty; expected JSON.",
        },
    )
    is_replacing = forms.BooleanField(
        label="Replace",
        required=False,
        help_text="Put the new row in the place of one with the same slug and other content.",
    )

    def __init__(self, request: HttpRequest) -> None:
        sent: tuple[Any, Any] = (None, None)
        super().__init__(*((request.POST, request.FILES) if request.method == "POST" else sent))

    def refuse(self, refusal: Exception) -> None:
        """Show every problem of the document at its field."""
        for problem in refusal.problems if isinstance(refusal, BadDocument) else ():
            self.add_error("file", problem)
        if not isinstance(refusal, BadDocument):
            super().refuse(refusal)

    def document(self) -> dict[str, Any]:
        """Parse the document. Raises `BadDocument`."""
        return papers.parse(self.cleaned_data["file"].read(papers.MAX_BYTES + 1))


class RemovalForm(SiteForm):
    reason = reason_field("One sentence for the audit log.", max_length=splits.MAX_REASON)


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
            messages.success(request, f"The row {row.method_name} of {split} was removed.")
            return redirect("maintain_published")
    return form_page(request, "maintain/published_remove.html", form, row=row)


@maintainers_form
def published(request: HttpRequest) -> HttpResponse:
    form = PaperForm(request)
    if form.is_valid():
        try:
            done = splits.import_published(
                document=form.document(),
                now=timezone.now(),
                is_replacing=form.cleaned_data["is_replacing"],
                actor=maintainer_of(request),
            )
        except Refused as refusal:
            form.refuse(refusal)
        else:
            words = (f"{len(names)} {outcome}" for outcome, names in vars(done).items())
            messages.success(request, f"Rows: {', '.join(words)}.")
            return redirect("maintain_published")
    return form_page(
        request, "maintain/published.html", form, rows=[(row, _overall_words(row)) for row in splits.quoted()]
    )


def _overall_words(row: PublishedResult) -> str:
    """The overall scores of a row."""
    values = ((metric, row.scores.get(metric.name)) for metric in known_metrics().values())
    words = (f"{each.symbol} {value}{each.unit_of_value}" for each, value in values if value is not None)
    return ", ".join(words) or "–"
