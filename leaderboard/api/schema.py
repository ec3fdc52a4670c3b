"""What the schema says of every operation alike: errors that any may give, and headers that all have."""

from collections.abc import Mapping
from typing import Any

from leaderboard import problem_codes
from leaderboard.api import descriptions

Node = dict[str, Any]

PROBLEM: Node = {problem_codes.MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Error"}}}
# Whatever is asked, and whoever asks: name, description.
ALWAYS: Mapping[str, tuple[str, str]] = {
    "400": ("Malformed", "The request is malformed."),
    "401": ("SignInFailed", "The sign-in is not valid, or there is none where one is needed."),
    "403": ("Forbidden", "The account or the token may not do this."),
    "404": ("NotFound", "There is nothing at this address that you may see."),
    "406": ("NotAcceptable", "The header Accept asks for a form that this address does not have."),
    "429": ("TooMany", "Too many requests in a short time; Retry-After says when to come back."),
    "503": ("Away", "Something that we need does not answer; Retry-After says when to ask again."),
}
WITH_A_BODY: Mapping[str, tuple[str, str]] = {
    "413": ("TooLarge", "The body is too large."),
    "415": ("UnknownBody", "The body's type is not taken here."),
}
HEADERS: Mapping[str, str] = {
    "RateLimit-Policy": "The limits that hold for whoever asks: name, requests (q), seconds (w).",
    "RateLimit": "What is left of them: name, requests (r), seconds until there are more (t).",
    "Retry-After": "Seconds until asking again is worth it.",
}
RETRY = {"429", "503"}


def complete(result: Node, generator: Any, **kwargs: Any) -> Node:
    """A drf-spectacular hook: give every operation the answers and headers that all of them have."""
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
                _describe(parameter, descriptions.PARAMETERS.get(parameter["name"]))
    for shape, node in result["components"]["schemas"].items():
        for name, field in node.get("properties", {}).items():
            _describe(field, descriptions.of(shape, name))
    return result


def _describe(node: Node, said: descriptions.Said | None) -> None:
    """What the serializer or the view says stays."""
    if said is None:
        return
    node.setdefault("description", said.text)
    if said.example is not None:
        node = node.get("schema", node)
        node.setdefault("examples", [said.example])


def _headers(status: str) -> Node:
    names = [name for name in HEADERS if name != "Retry-After" or status in RETRY]
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}


def _complete(responses: Node, *, has_body: bool) -> None:
    """What an operation says itself stays, with the headers; the rest is a reference."""
    shared = {**ALWAYS, **(WITH_A_BODY if has_body else {})}
    for status, response in responses.items():
        response.setdefault("headers", {}).update(_headers(status))
        response["description"] = response["description"] or shared.get(status, ("", ""))[1]
    for status, (name, _) in shared.items():
        responses.setdefault(status, {"$ref": f"#/components/responses/{name}"})
    for status in sorted(responses):
        responses[status] = responses.pop(status)
