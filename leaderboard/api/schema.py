"""The schema, and what all operations share: errors, headers and path parameters."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from django.http import HttpResponse
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.utils import OpenApiParameter, extend_schema
from drf_spectacular.views import SpectacularAPIView
from rest_framework.permissions import AllowAny
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request
from rest_framework.response import Response

from leaderboard.api.parsers import UniformJSONRenderer
from leaderboard.api.serializers import ErrorSerializer
from leaderboard.errors import problem_codes

Node = dict[str, Any]

PROBLEM: Node = {problem_codes.MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Error"}}}
# Answers of every operation: status, name, description.
ALWAYS: Mapping[str, tuple[str, str]] = {
    "400": ("Malformed", "The request is malformed."),
    "401": ("SignInFailed", "The credentials are invalid, or missing where an account is needed."),
    "403": ("Forbidden", "The account or the token may not do this."),
    "404": ("NotFound", "There is nothing at this address that you may see."),
    "406": ("NotAcceptable", "The header Accept asks for a format that this path does not offer."),
    "429": ("TooMany", "Too many requests in a short time; repeat after Retry-After seconds."),
    "503": ("Away", "A service that we need does not answer; repeat after Retry-After seconds."),
}
WITH_A_BODY: Mapping[str, tuple[str, str]] = {
    "413": ("TooLarge", "The body is too large."),
    "415": ("UnknownBody", "The content type of the body is not accepted."),
}
# What operations answer that declare these statuses; the code says why.
DECLARED: Mapping[str, str] = {
    "409": "The state of the split or the submission does not allow this; `code` says why.",
    "422": "A field is missing or has a value that is not accepted; `where` names it.",
}
HEADERS: Mapping[str, str] = {
    "RateLimit-Policy": "The limits of the client: name, requests (q), seconds (w).",
    "RateLimit": "What remains of them: name, requests (r), seconds until there are more (t).",
    "Retry-After": "Seconds after which to repeat the request.",
}
RETRY = {"429", "503"}
PATH_PARAMETERS: Mapping[str, str] = {
    "split": "Name of the split.",
    "number": "Number of the edition.",
    "submission_id": "Id of the submission.",
    "method_id": "Id of the method.",
    "name": "Name of the table.",
}


def errors(*statuses: int) -> dict[tuple[int, str], type[ErrorSerializer]]:
    """Return the problem documents of these statuses, for `extend_schema`."""
    return {(status, problem_codes.MEDIA_TYPE): ErrorSerializer for status in statuses}


def response_header(name: str, of: type, description: str, *, statuses: list[int | str]) -> OpenApiParameter:
    """Return a header of the responses with these statuses, for `extend_schema`."""
    return OpenApiParameter(name, of, OpenApiParameter.HEADER, description=description, response=statuses)


def complete(result: Node, generator: Any, **kwargs: Any) -> Node:
    """Add the answers and headers that no view declares (a hook of drf-spectacular)."""
    components = result["components"]
    components["headers"] = {
        name: {"description": about, "schema": {"type": "string"}} for name, about in HEADERS.items()
    }
    components["responses"] = {
        name: {"description": about, "content": PROBLEM, "headers": _headers(status)}
        for status, (name, about) in {**ALWAYS, **WITH_A_BODY}.items()
    }
    for path in result["paths"].values():
        for operation in path.values():
            _complete(operation["responses"], has_body="requestBody" in operation)
            for parameter in operation.get("parameters", []):
                if parameter["in"] == "path":
                    parameter["description"] = PATH_PARAMETERS[parameter["name"]]
    return result


def _headers(status: str) -> Node:
    names = [name for name in HEADERS if name != "Retry-After" or status in RETRY]
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}


def _complete(responses: Node, *, has_body: bool) -> None:
    shared = {**ALWAYS, **(WITH_A_BODY if has_body else {})}
    for status, response in responses.items():
        response.setdefault("headers", {}).update(_headers(status))
        about = shared.get(status, ("", ""))[1] or DECLARED.get(status, "")
        response["description"] = response["description"] or about
    for status, (name, _) in shared.items():
        responses.setdefault(status, {"$ref": f"#/components/responses/{name}"})
    for status in sorted(responses):
        responses[status] = responses.pop(status)


class SchemaView(SpectacularAPIView):
    permission_classes = [AllowAny]

    @extend_schema(exclude=True)
    def get(self, request: Request, *args: Any, **kwargs: Any) -> HttpResponse:
        """The whole of it, in the form that the request accepts."""
        renderer: BaseRenderer = request.accepted_renderer
        return HttpResponse(
            _written(renderer.media_type),
            content_type=f"{renderer.media_type}; charset=utf-8",
            headers={"Content-Disposition": f'inline; filename="tsttc-openapi.{renderer.format}"'},
        )

    def handle_exception(self, exc: Exception) -> Response:
        # A problem document is JSON whatever form of the schema the request accepts.
        self.request.accepted_renderer = UniformJSONRenderer()
        return super().handle_exception(exc)


@cache
def _written(media_type: str) -> bytes:
    renderer = next(kind for kind in SchemaView.renderer_classes if kind.media_type == media_type)
    text = renderer().render(SchemaGenerator().get_schema(request=None, public=True), renderer_context={})
    return text.encode() if isinstance(text, str) else text
