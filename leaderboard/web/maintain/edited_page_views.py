"""Editing of rules, contact, privacy, imprint and licence."""

from typing import Any

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.pages import texts
from leaderboard.pages.texts import MAX_TEXT, PAGES
from leaderboard.web import markdown
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
    maintainers_only,
)


class PageForm(SiteForm):
    text = forms.CharField(
        strip=False,
        help_text="Markdown: ## headings, lists, tables, **bold**, [links](https://…). HTML tags and images "
        f"do not work. At most {MAX_TEXT:,} characters.",
        widget=forms.Textarea(attrs={"rows": 24, "class": "digest"}),
        error_messages={"required": "The text is empty; expected at least a sentence."},
    )
    replaces = forms.IntegerField(
        widget=forms.HiddenInput,
        error_messages=dict.fromkeys(("required", "invalid"), "The form lacks the version; reload the page."),
    )


@maintainers_only
@require_safe
def site_pages(request: HttpRequest) -> HttpResponse:
    rows = [(page, texts.current(page.name)) for page in PAGES.values()]
    return render(request, "maintain/pages.html", {"rows": rows, "imprint": texts.IMPRINT})


@maintainers_form
def site_page(request: HttpRequest, page_name: str) -> HttpResponse:
    """Show the form with a version of the text, a preview, and the history."""
    versions = texts.versions(page_name)
    chosen = next((each for each in versions if str(each.number) == request.GET.get("version")), None)
    shown = chosen or (versions[0] if versions else None)
    text = shown.text if shown and request.GET.get("version") != "0" else texts.default_text(page_name)
    form = PageForm.asked(request, initial={"text": text, "replaces": versions[0].number if versions else 0})
    context: dict[str, Any] = {"page": PAGES[page_name], "versions": versions}
    if form.is_valid():
        if "preview" in request.POST:
            return form_page(
                request,
                "maintain/page.html",
                form,
                preview=markdown.page(form.cleaned_data["text"]),
                **context,
            )
        with form.refusals():
            texts.edit(name=page_name, actor=maintainer_of(request), now=timezone.now(), **form.cleaned_data)
            messages.success(request, f"{PAGES[page_name].title} was changed.")
            return redirect("site_page", page_name)
    return form_page(request, "maintain/page.html", form, **context)
