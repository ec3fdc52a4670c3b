"""Exceptions of the API, and the problem document (RFC 9457) of each."""

from typing import Any, NoReturn

from django.core.exceptions import BadRequest, PermissionDenied, RequestDataTooBig, SuspiciousOperation
from django.http import Http404, UnreadablePostError
from django.utils import timezone
from rest_framework import exceptions
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView
from rest_framework.views import exception_handler as default_handler

from leaderboard.api import request_faults
from leaderboard.api.throttling import UnauthorizedThrottle
from leaderboard.boards import filters, listing
from leaderboard.errors import outages, problem_codes
from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.ops import rate_limits
from leaderboard.quotas import usage
from leaderboard.statistics import comparison_queue, comparisons

UNAUTHORIZED = (exceptions.NotAuthenticated, exceptions.AuthenticationFailed, exceptions.PermissionDenied)


class BadValue(Exception):
    """An invalid value of a query parameter."""

    def __init__(self, code: str, name: str, given: str, expected: str) -> None:
        super().__init__(f"The parameter '{name}' is {given[:60]!r}; expected {expected}.")
        self.code = code
        self.where = name


def whole_number(text: str, *, name: str, code: str, limits: range, expected: str) -> int:
    """Parse a whole number within limits. Raises `BadValue`."""
    if not (text.isascii() and text.isdecimal() and len(text) < 10 and int(text) in limits):
        raise BadValue(code, name, text, expected)
    return int(text)


def edition_number(text: str) -> int:
    """Parse the parameter `edition`. Raises `BadValue`."""
    return whole_number(
        text, name="edition", code="bad-edition", limits=range(10**9), expected="the number of an edition"
    )


def problem(
    *, status: int, code: str, detail: str, where: str = "", headers: dict[str, str] | None = None
) -> Response:
    """Answer with one problem."""
    return Response(
        problem_codes.document(status=status, code=code, detail=detail, where=where),
        status=status,
        headers=headers,
        content_type=problem_codes.MEDIA_TYPE,
    )


def exception_handler(exc: Exception, context: dict[str, Any]) -> Response | None:
    """Make the problem document of an exception; too many failed authentications are a 429."""
    if isinstance(exc, UNAUTHORIZED):
        # Such a request ends before the throttles of its view are asked.
        throttle = UnauthorizedThrottle()
        if not throttle.allow_request(context["request"], context["view"]):
            exc = exceptions.Throttled(throttle.wait())
    return _outage(exc, context) or _domain_error(exc) or _bad_request(exc) or _framework_error(exc, context)


def _outage(exc: Exception, context: dict[str, Any]) -> Response | None:
    outage = outages.answered(exc, marks=context["request"].META)
    if outage is None:
        return None
    return problem(status=outage.status, code=outage.code, detail=outage.sentence, headers=outage.headers)


# What the domain raises besides `Refused`: status, code, and the input at fault.
DOMAIN_ERRORS: dict[type[Exception], tuple[int, str, str]] = {
    listing.UnknownColumn: (400, "unknown-column", "sort"),
    listing.BadTime: (400, "bad-moment", "at"),
    NotMaintainer: (403, "not-maintainer", ""),
    comparisons.BadComparison: (400, comparisons.BadComparison.code, "m"),
    comparisons.UnknownMethod: (404, comparisons.UnknownMethod.code, "m"),
    comparisons.NotOnTheBoard: (404, comparisons.NotOnTheBoard.code, "m"),
}


def _domain_error(exc: Exception) -> Response | None:
    match exc:
        case Refused():
            status, *_ = problem_codes.STATUSES.get(exc.code, (422,))
            return problem(status=status, code=exc.code, detail=str(exc), where=exc.field)
        case usage.QuotaExceeded() | comparison_queue.TooManyComparisons():
            return _not_yet(exc)
        case filters.BadFilter():
            return problem(status=400, code="bad-filter", detail=str(exc), where=exc.field)
    if type(exc) not in DOMAIN_ERRORS:
        return None
    status, code, where = DOMAIN_ERRORS[type(exc)]
    return problem(status=status, code=code, detail=str(exc), where=where)


def _not_yet(exc: usage.QuotaExceeded | comparison_queue.TooManyComparisons) -> Response:
    if isinstance(exc, usage.QuotaExceeded):
        retry_after_s = exc.quota.retry_after_s(now=timezone.now())
    else:
        retry_after_s = exc.retry_after_s
    headers = {"Retry-After": str(retry_after_s)} if retry_after_s else None
    return problem(status=429, code=exc.code, detail=str(exc), where=exc.field, headers=headers)


def _bad_request(exc: Exception) -> Response | None:
    if isinstance(exc, BadValue):
        return problem(status=400, code=exc.code, detail=str(exc), where=exc.where)
    if isinstance(exc, RequestDataTooBig):
        sentence = "The fields of the request are larger than any field may be; expected a file in 'file'."
        return problem(status=413, code="too-large", detail=sentence)
    if isinstance(exc, SuspiciousOperation | BadRequest | UnreadablePostError):
        # Its own text is about Django's settings.
        sentence = (
            "The request is malformed or incomplete; expected a complete request, as the API describes it."
        )
        return problem(status=400, code="bad-request", detail=sentence)
    return None


def _framework_error(exc: Exception, context: dict[str, Any]) -> Response | None:
    match exc:
        case Http404():
            meant = request_faults.of_unknown_address(context["request"].path)
            exc = exceptions.NotFound(meant or "There is nothing at this address that you may see.")
        case PermissionDenied():
            exc = exceptions.PermissionDenied()
    response = default_handler(exc, context)
    if response is None:
        return None
    codes = exc.get_codes() if isinstance(exc, exceptions.APIException) else "invalid"
    code = (codes if isinstance(codes, str) else "invalid").replace("_", "-")
    headers = {name: value for name, value in response.items() if name != "Content-Type"}
    return problem(status=response.status_code, code=code, detail=_sentence(exc, context), headers=headers)


def _sentence(exc: Exception, context: dict[str, Any]) -> str:
    request, view = context["request"], context["view"]
    match exc:
        case exceptions.Throttled():
            return rate_limits.refusal(getattr(exc, "wait", None) or 0)
        case exceptions.NotAuthenticated():
            text = request_faults.of_token(request)
        case exceptions.UnsupportedMediaType():
            text = request_faults.of_media_type(exc, request)
        case exceptions.ParseError():
            text = request_faults.of_body(exc)
        case exceptions.MethodNotAllowed():
            text = request_faults.of_method(request, view)
        case exceptions.NotAcceptable():
            text = request_faults.of_accept(request, view)
        case _:
            text = _detail(exc)
    return text if text.endswith(".") else f"{text}."


def _detail(exc: Exception) -> str:
    detail = getattr(exc, "detail", "")
    if isinstance(detail, str):
        return str(detail)
    return "; ".join(f"{key}: {text}" for key, text in dict(detail).items())


class UnknownAddressView(APIView):
    """Answers other paths below /api/ by a 404 as a problem document."""

    permission_classes = [AllowAny]
    schema = None

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> NoReturn:
        # Before authentication and throttling.
        raise Http404
