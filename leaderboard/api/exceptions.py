"""Errors of the API, in one shape: RFC 9457 `application/problem+json`."""

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

from leaderboard import (
    admissions,
    comparisons,
    filters,
    idempotency,
    outages,
    problem_codes,
    questions,
    quotas,
    rates,
    receipts,
    rescoring,
    standings,
    submissions,
)


class BadValue(Exception):
    """A parameter of the request has a value that it cannot have."""

    def __init__(self, code: str, name: str, found: str, expected: str) -> None:
        super().__init__(f"The parameter '{name}' is {found[:60]!r}; expected {expected}.")
        self.code = code
        self.where = name


def edition_number(text: str) -> int:
    """A parameter that names an edition. Raises `BadValue`."""
    if not (text.isascii() and text.isdecimal() and len(text) < 10):
        raise BadValue("bad-edition", "edition", text, "the number of an edition")
    return int(text)


def problem(
    *, status: int, code: str, detail: str, where: str = "", headers: dict[str, str] | None = None
) -> Response:
    """One problem as a response."""
    return Response(
        problem_codes.document(status=status, code=code, detail=detail, where=where),
        status=status,
        headers=headers,
        content_type=problem_codes.MEDIA_TYPE,
    )


def exception_handler(exc: Exception, context: dict[str, Any]) -> Response | None:
    """Translate what the verbs raise; everything else keeps the framework's status."""
    return _outage(exc) or _of_a_verb(exc) or _of_the_request(exc) or _of_the_framework(exc, context)


def _outage(exc: Exception) -> Response | None:
    outage = outages.outage_of(exc)
    if outage is None:
        return None
    return problem(status=outage.status, code=outage.code, detail=outage.sentence, headers=outage.headers)


# What verbs raise beside `submissions.Refused`: status, code, and the input at fault.
OF_VERBS: dict[type[Exception], tuple[int, str, str]] = {
    standings.UnknownColumn: (400, "unknown-column", "sort"),
    standings.BadMoment: (400, "bad-moment", "at"),
    rescoring.Refused: (409, "edition-refused", ""),
    rescoring.NotMaintainer: (403, "not-maintainer", ""),
    idempotency.BadKey: (400, "bad-idempotency-key", "Idempotency-Key"),
    idempotency.KeyReused: (409, "idempotency-key-reused", "Idempotency-Key"),
    comparisons.BadComparison: (400, comparisons.BadComparison.code, "m"),
    comparisons.UnknownMethod: (404, comparisons.UnknownMethod.code, "m"),
    comparisons.NotOnTheBoard: (404, comparisons.NotOnTheBoard.code, "m"),
}


def _of_a_verb(exc: Exception) -> Response | None:
    match exc:
        case submissions.Refused():
            status = 413 if isinstance(exc, submissions.TooLarge) else 422
            if exc.code in {"split-not-open", "split-closed"}:
                status = 409
            if isinstance(exc, submissions.TokenSplit | admissions.NotAdmitted):
                status = 403
            return problem(status=status, code=exc.code, detail=str(exc), where=exc.field)
        case quotas.QuotaExceeded() | questions.TooManyWaiting():
            return _not_yet(exc)
        case filters.BadFilter():
            return problem(status=400, code="bad-filter", detail=str(exc), where=exc.field)
        case receipts.NoReceipt():
            status = 404 if exc.code == "edition-unknown" else 409
            return problem(status=status, code=exc.code, detail=str(exc))
    if type(exc) not in OF_VERBS:
        return None
    status, code, where = OF_VERBS[type(exc)]
    return problem(status=status, code=code, detail=str(exc), where=where)


def _not_yet(exc: quotas.QuotaExceeded | questions.TooManyWaiting) -> Response:
    """What is taken later."""
    if isinstance(exc, quotas.QuotaExceeded):
        retry_after_s = exc.quota.retry_after_s(now=timezone.now())
    else:
        retry_after_s = exc.retry_after_s
    headers = {"Retry-After": str(retry_after_s)} if retry_after_s else None
    return problem(status=429, code=exc.code, detail=str(exc), where=exc.field, headers=headers)


def _of_the_request(exc: Exception) -> Response | None:
    """What is wrong with a request before any verb has seen it."""
    if isinstance(exc, BadValue):
        return problem(status=400, code=exc.code, detail=str(exc), where=exc.where)
    if isinstance(exc, RequestDataTooBig):
        sentence = "The fields of the request are larger than any field may be; expected a file in 'file'."
        return problem(status=413, code="too-large", detail=sentence)
    if isinstance(exc, SuspiciousOperation | BadRequest | UnreadablePostError):
        # Its own text is about Django's settings.
        sentence = "The request is malformed, or was broken off; expected it whole, as the API describes it."
        return problem(status=400, code="bad-request", detail=sentence)
    return None


def _of_the_framework(exc: Exception, context: dict[str, Any]) -> Response | None:
    match exc:
        case Http404():
            exc = exceptions.NotFound("There is nothing at this address that you may see.")
        case PermissionDenied():
            exc = exceptions.PermissionDenied()
    response = default_handler(exc, context)
    if response is None:
        return None
    codes = exc.get_codes() if isinstance(exc, exceptions.APIException) else "invalid"
    code = (codes if isinstance(codes, str) else "invalid").replace("_", "-")
    headers = {name: value for name, value in response.items() if name != "Content-Type"}
    return problem(status=response.status_code, code=code, detail=_sentence(exc), headers=headers)


def _sentence(exc: Exception) -> str:
    if isinstance(exc, exceptions.Throttled):
        wait_s: float = getattr(exc, "wait", None) or 0
        return rates.refusal(wait_s)
    detail = getattr(exc, "detail", "")
    text = (
        str(detail)
        if isinstance(detail, str)
        else "; ".join(f"{key}: {text}" for key, text in dict(detail).items())
    )
    return text if text.endswith(".") else f"{text}."


class NowhereView(APIView):
    """Every address below /api/ that is none: answered in the shape of the others."""

    permission_classes = [AllowAny]
    schema = None

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> NoReturn:
        """Before anything is asked of the request: whoever asks, there is nothing here."""
        raise Http404
