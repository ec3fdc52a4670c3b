"""The size of a request is judged by its header, before any of its body is read."""

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render

from leaderboard import problem_codes, submissions

# Room for the other fields and the boundaries of a multipart body.
FORM_BYTES = 100_000


class UploadLimitMiddleware:
    """Answers 413 to a request that announces more than a prediction file may have."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Let small requests pass."""
        announced = request.META.get("CONTENT_LENGTH") or "0"
        if announced.isdecimal() and int(announced) <= settings.MAX_PREDICTIONS_BYTES + FORM_BYTES:
            return self.get_response(request)
        sentence = submissions.too_large(found_bytes=int(announced) if announced.isdecimal() else 0)
        if not request.path.startswith("/api/"):
            response = render(request, "413.html", {"sentence": sentence}, status=413)
        else:
            response = JsonResponse(
                problem_codes.document(status=413, code="too-large", detail=sentence, where="file"),
                status=413,
                content_type=problem_codes.MEDIA_TYPE,
            )
        return response
