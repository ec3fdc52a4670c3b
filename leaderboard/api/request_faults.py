"""Sentences about a request that the framework refuses: what came, and what was expected."""

import re
from collections.abc import Iterable
from typing import Any, Final

from django.urls import Resolver404, resolve
from rest_framework import exceptions
from rest_framework.request import Request

EXPECTED_HEADER: Final = "expected the header 'Authorization: Bearer tsttc_…'"
_ELSEWHERE: Final = {
    "HTTP_X_API_KEY": "X-API-Key",
    "HTTP_API_KEY": "Api-Key",
    "HTTP_X_AUTH_TOKEN": "X-Auth-Token",
    "HTTP_X_ACCESS_TOKEN": "X-Access-Token",
    "HTTP_PRIVATE_TOKEN": "Private-Token",
    "HTTP_TOKEN": "Token",
    "HTTP_PROXY_AUTHORIZATION": "Proxy-Authorization",
}
_SCHEME: Final = re.compile(r"[A-Za-z][A-Za-z0-9-]{0,19}")
_CURL: Final = "With curl, -F writes it; add no Content-Type of your own"


def of_token(request: Request) -> str:
    """Say why a request has no token that can be read. Never repeats what may be a secret."""
    header = str(request.META.get("HTTP_AUTHORIZATION", "")).strip()
    scheme, _, rest = header.partition(" ")
    if not header:
        return f"{_of_absent_header(request)}; {EXPECTED_HEADER}"
    if scheme.lower() == "bearer":
        fault = "The token contains spaces" if rest.strip() else "No token comes after Bearer"
    elif not rest or not _SCHEME.fullmatch(scheme):
        fault = "The header Authorization does not begin with Bearer"
    else:
        fault = f"The header Authorization begins with {scheme}"
    return f"{fault}; {EXPECTED_HEADER}"


def _of_absent_header(request: Request) -> str:
    names = [name for key, name in _ELSEWHERE.items() if request.META.get(key)]
    if names:
        return f"The token came in the header {names[0]}"
    if "token" in request.query_params or "access_token" in request.query_params:
        return "The token came in the address, where others can read it"
    return "The request has no token"


def of_media_type(exc: exceptions.UnsupportedMediaType, request: Request) -> str:
    kinds = [parser.media_type for parser in request.parsers or ()]
    given = re.search(r'"(.*)"', str(exc.detail))
    media_type = given[1].partition(";")[0][:60] if given else ""
    sent = f"The body is {media_type}" if media_type else "The request has no Content-Type"
    example = ""
    if kinds == ["multipart/form-data"]:
        example = " With curl: -F file=@FILE -F split=SPLIT --form-string method=NAME"
    return f"{sent}; expected {_or(kinds)}.{example}"


def of_body(exc: exceptions.ParseError) -> str:
    """Word a body that its parser does not understand."""
    text = str(exc.detail)
    if "invalid boundary" in text.lower():
        return f"The Content-Type of the form has no usable boundary; expected boundary=… in it. {_CURL}"
    kind, _, reason = text.partition(" parse error - ")
    if not reason:
        return text
    expected = "JSON text" if kind == "JSON" else "a complete form"
    reason = f"{reason[:1].lower()}{reason[1:200]}".rstrip(".")
    return f"The body cannot be read: {reason}; expected {expected}"


def of_method(request: Request, view: Any) -> str:
    allowed = [name for name in view.allowed_methods if name not in {"OPTIONS", "HEAD"}]
    return f"{str(request.method)[:20]} is not possible at this address; expected {_or(allowed)}"


def of_accept(request: Request, view: Any) -> str:
    kinds = [renderer.media_type for renderer in view.get_renderers()]
    accept = str(request.META.get("HTTP_ACCEPT", ""))[:60]
    return (
        f"The header Accept is {accept!r}, but this address answers with {_or(kinds)}; expected that, or */*"
    )


def of_unknown_address(path: str) -> str:
    """Say which address was probably meant; empty if none is like it."""
    plain = re.sub(r"/+", "/", path).rstrip("/")
    versioned = re.sub(r"^/api/(?:v[0-9]+/)?", "/api/v1/", plain)
    for candidate, fault in (
        (plain, "a slash at its end" if path.endswith("/") and "//" not in path else "a doubled slash"),
        (versioned, "another version"),
    ):
        if candidate != path and _is_known(candidate):
            return f"The address has {fault}; expected {candidate}"
    return ""


def _is_known(path: str) -> bool:
    try:
        return resolve(path).url_name is not None
    except Resolver404:
        return False


def _or(names: Iterable[str]) -> str:
    return " or ".join(dict.fromkeys(names))
