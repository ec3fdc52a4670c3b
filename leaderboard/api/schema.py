"""The schema, and what all operations share in it: errors and headers, path parameters, examples."""

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

from evaluator.metrics.protocol import known_names
from leaderboard.api.parsers import UniformJSONRenderer
from leaderboard.api.serializers import ErrorSerializer
from leaderboard.errors import problem_codes
from leaderboard.methods.details import DETAILS

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
# What a value looks like: by the format of its field, else by the field's type and name.
FORMATS: Mapping[str, str] = {
    "uuid": "0f8b1c2d-3e4f-4a5b-8c6d-7e8f9a0b1c2d",
    "date-time": "2026-11-21T10:00:00Z",
    "uri": "https://leaderboard.example.org/",
}
DIGEST = "sha256:" + "5de94cec" * 8
EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "string": {
        "split": "test",
        "protocol": "tsttc-1",
        "ground_truth": DIGEST,
        "manifest": DIGEST,
        "digest": DIGEST,
        "method": "Deep Scale",
        "team": "Owls",
        "description": "Scale regression on six frames.",
        "paper_url": "https://example.org/paper",
        "code_url": "https://example.org/code",
        "date": "2026-11-21",
        "sort": "rank",
        "reason": "Corrected labels of three recordings.",
        "type": "https://leaderboard.example.org/docs/api/#problem-quota-exceeded",
        "code": "quota-exceeded",
        "where": "/predictions/12",
        "note": "learning rate 1e-4",
        "commit": "0a1b2c3",
    },
    "integer": {
        "number": 1,
        "edition": 3,
        "n_sequences": 28600,
        "n_recordings": 120,
        "size_bytes": 600_000,
        "status": 429,
    },
    "number": {
        **dict.fromkeys(known_names(), 15.03),
        "rate_per_s": 3.6,
    },
    "object": {"truncated": {"20": 3}},
}
DETAIL_EXAMPLES: Mapping[str, Any] = {detail.name: detail.example for detail in DETAILS}


def errors(*statuses: int) -> dict[tuple[int, str], type[ErrorSerializer]]:
    """The problem documents that an operation answers with these statuses, for `extend_schema`."""
    return {(status, problem_codes.MEDIA_TYPE): ErrorSerializer for status in statuses}


def response_header(name: str, of: type, description: str, *, statuses: list[int | str]) -> OpenApiParameter:
    """A header of an operation's responses with these statuses, for `extend_schema`."""
    return OpenApiParameter(name, of, OpenApiParameter.HEADER, description=description, response=statuses)


def complete(result: Node, generator: Any, **kwargs: Any) -> Node:
    """A drf-spectacular hook: add the answers, headers and examples that no view declares."""
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
                _describe_path_parameter(parameter)
    for schema in components["schemas"].values():
        for name, field in schema.get("properties", {}).items():
            _add_example(field, name)
    return result


def _describe_path_parameter(parameter: Node) -> None:
    if parameter["in"] == "path":
        parameter["description"] = PATH_PARAMETERS[parameter["name"]]
        _add_example(parameter["schema"], parameter["name"])


def _add_example(field: Node, name: str) -> None:
    if name in DETAIL_EXAMPLES:
        field["examples"] = [DETAIL_EXAMPLES[name]]
    types = field.get("type", [])
    for each in [types] if isinstance(types, str) else types:
        example = FORMATS.get(field.get("format", "")) or EXAMPLES.get(each, {}).get(name)
        if example is not None and "enum" not in field:
            field["examples"] = [example]


def _headers(status: str) -> Node:
    names = [name for name in HEADERS if name != "Retry-After" or status in RETRY]
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}


def _complete(responses: Node, *, has_body: bool) -> None:
    """Add headers to the declared answers, and references to the shared ones."""
    shared = {**ALWAYS, **(WITH_A_BODY if has_body else {})}
    for status, response in responses.items():
        response.setdefault("headers", {}).update(_headers(status))
        response["description"] = response["description"] or shared.get(status, ("", ""))[1]
    for status, (name, _) in shared.items():
        responses.setdefault(status, {"$ref": f"#/components/responses/{name}"})
    for status in sorted(responses):
        responses[status] = responses.pop(status)


class SchemaView(SpectacularAPIView):
    """The schema as OpenAPI 3.1, as YAML or as JSON. It is the same for everybody."""

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
        """A problem document is JSON whatever form of the schema the request accepts."""
        self.request.accepted_renderer = UniformJSONRenderer()
        return super().handle_exception(exc)


@cache
def _written(media_type: str) -> bytes:
    renderer = next(kind for kind in SchemaView.renderer_classes if kind.media_type == media_type)
    text = renderer().render(SchemaGenerator().get_schema(request=None, public=True), renderer_context={})
    return text.encode() if isinstance(text, str) else text
