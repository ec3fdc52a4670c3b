"""Errors of the API, in one shape: RFC 9457 `application/problem+json`."""

import math
from http import HTTPStatus
from typing import Any

from django.core.exceptions import PermissionDenied
from django.http import Http404
from django.utils import timezone
from rest_framework import exceptions
from rest_framework.response import Response
from rest_framework.views import exception_handler as default_handler

from leaderboard import outages, quotas, rescoring, standings, submissions


def problem(
    *, status: int, code: str, detail: str, where: str = "", headers: dict[str, str] | None = None
) -> Response:
    """One problem as a response."""
    return Response(
        {
            "type": "about:blank",
            "title": HTTPStatus(status).phrase,
            "status": status,
            "code": code,
            "detail": detail,
            "problems": [{"code": code, "message": detail, "where": where}],
        },
        status=status,
        headers=headers,
        content_type="application/problem+json",
    )


def exception_handler(exc: Exception, context: dict[str, Any]) -> Response | None:
    """Translate what the verbs raise; everything else keeps the framework's status."""
    return _outage(exc) or _of_a_verb(exc) or _of_the_framework(exc, context)


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
}


def _of_a_verb(exc: Exception) -> Response | None:
    if isinstance(exc, submissions.Refused):
        status = 413 if isinstance(exc, submissions.TooLarge) else 422
        if exc.code in {"split-not-open", "split-closed"}:
            status = 409
        return problem(status=status, code=exc.code, detail=str(exc), where=exc.field)
    if isinstance(exc, quotas.QuotaExceeded):
        retry_after_s = exc.quota.retry_after_s(now=timezone.now())
        headers = {"Retry-After": str(retry_after_s)} if retry_after_s else None
        return problem(status=429, code=exc.code, detail=str(exc), where=exc.field, headers=headers)
    if type(exc) not in OF_VERBS:
        return None
    status, code, where = OF_VERBS[type(exc)]
    return problem(status=status, code=code, detail=str(exc), where=where)


def _of_the_framework(exc: Exception, context: dict[str, Any]) -> Response | None:
    match exc:
        case Http404():
            exc = exceptions.NotFound("There is nothing at this address that you may see.")
        case PermissionDenied():
            exc = exceptions.PermissionDenied()
    response = default_handler(exc, context)
    if response is None:
        return None
    codes = exc.get_codes() if isinstance(exc, exceptions.APIException) else "error"
    code = (codes if isinstance(codes, str) else "invalid").replace("_", "-")
    headers = {name: value for name, value in response.items() if name != "Content-Type"}
    return problem(status=response.status_code, code=code, detail=_sentence(exc), headers=headers)


def _sentence(exc: Exception) -> str:
    if isinstance(exc, exceptions.Throttled):
        wait_s: float = getattr(exc, "wait", None) or 0
        return f"Too many requests in a short time; the next one is answered in {math.ceil(wait_s)} s."
    detail = getattr(exc, "detail", "")
    return (
        str(detail)
        if isinstance(detail, str)
        else "; ".join(f"{key}: {text}" for key, text in dict(detail).items())
    )
