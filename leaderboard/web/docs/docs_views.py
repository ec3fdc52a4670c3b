"""The pages of documentation."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from leaderboard.web.docs import api_reference, reference


@require_safe
def docs(request: HttpRequest) -> HttpResponse:
    """How to submit, the file's format, the errors, the API."""
    return render(request, "docs/docs.html", reference.docs())


@require_safe
def api_page(request: HttpRequest) -> HttpResponse:
    """Every operation, parameter and object of the API."""
    return render(request, "docs/api_reference.html", {"api": api_reference.reference()})
