"""The API's reference as a plain page, drawn from the same schema that programs read.

The usual viewers of such schemas style themselves inline and load fonts from elsewhere; this site's policy
forbids both.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from http import HTTPStatus
from typing import Any, Final

from evaluator.problems import PROBLEM_CODES
from leaderboard import problem_codes

Node = Mapping[str, Any]
# What the schema's generator appends for a choice that has no words of its own.
_BARE_CHOICE: Final = re.compile(r"^\* `([^`]+)` - \1$", re.MULTILINE)


@dataclass(frozen=True)
class Kind:
    """What a value is, in words; `shape` names the shape to look up, if it is one."""

    text: str
    shape: str = ""


@dataclass(frozen=True)
class Field:
    """A parameter, or a field of a shape."""

    name: str
    kind: Kind
    about: str
    is_required: bool


@dataclass(frozen=True)
class Answer:
    """What comes back with one status."""

    status: int
    phrase: str
    kind: Kind
    about: str


@dataclass(frozen=True)
class Operation:
    """One method on one path."""

    name: str
    method: str
    path: str
    about: str
    needs_account: bool
    parameters: tuple[Field, ...]
    body: tuple[Field, ...]
    answers: tuple[Answer, ...]


@dataclass(frozen=True)
class Shape:
    """One named JSON object."""

    name: str
    about: str
    fields: tuple[Field, ...]


@dataclass(frozen=True)
class Reference:
    """The whole API."""

    operations: tuple[Operation, ...]
    shapes: tuple[Shape, ...]
    codes: tuple[tuple[str, str], ...] = tuple(problem_codes.API_CODES.items())
    file_codes: tuple[tuple[str, str], ...] = tuple(
        (code, about) for code, about in PROBLEM_CODES.items() if code not in problem_codes.API_CODES
    )


@cache
def reference() -> Reference:
    """The reference; the schema cannot change while the process lives."""
    from drf_spectacular.generators import SchemaGenerator  # noqa: PLC0415 - needs the settings; `read` does not

    schema: dict[str, Any] = SchemaGenerator().get_schema(request=None, public=True)
    return read(schema)


def read(schema: Node) -> Reference:
    """The reference that an OpenAPI schema describes."""
    named = schema["components"]["schemas"]
    shapes = _spelt_out(named, named)
    return Reference(
        operations=tuple(
            _operation(path, method, node, shapes)
            for path, methods in _spelt_out(schema["paths"], named).items()
            for method, node in methods.items()
        ),
        shapes=tuple(
            Shape(name, node.get("description", ""), _fields(node))
            for name, node in shapes.items()
            if "properties" in node
        ),
    )


def _spelt_out(node: Any, named: Node) -> Any:
    """The same tree, with what is named but no object (an enumeration, say) in the place of its name."""
    if isinstance(node, list):
        return [_spelt_out(each, named) for each in node]
    if not isinstance(node, Mapping):
        return node
    target = named.get(str(node.get("$ref", "")).rpartition("/")[2])
    if target is not None and "properties" not in target:
        # What a field says beside naming it, its own description, goes before the enumeration's.
        return {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return {key: _spelt_out(value, named) for key, value in node.items()}


def _operation(path: str, method: str, node: Node, shapes: Node) -> Operation:
    content = node.get("requestBody", {}).get("content", {})
    body = [shapes[_kind(media["schema"]).shape] for media in content.values()][:1]
    return Operation(
        name=node["operationId"],
        method=method.upper(),
        path=path,
        about=node.get("description", ""),
        needs_account={} not in node.get("security", []),
        parameters=tuple(
            Field(p["name"], _kind(p["schema"]), p.get("description", ""), p.get("required", False))
            for p in sorted(
                node.get("parameters", []), key=lambda p: (p["in"] != "path", path.find(p["name"]))
            )
        ),
        body=_fields(body[0]) if body else (),
        answers=tuple(_answers(node["responses"])),
    )


def _answers(responses: Node) -> Iterable[Answer]:
    for status, node in sorted(responses.items()):
        if "$ref" in node:
            # What any operation may answer with; the page says it once.
            continue
        media = next(iter(node.get("content", {"": {}}).values()))
        yield Answer(
            status=int(status),
            phrase=HTTPStatus(int(status)).phrase,
            kind=_kind(media.get("schema", {})),
            about=node.get("description", ""),
        )


def _fields(node: Node) -> tuple[Field, ...]:
    required = node.get("required", [])
    return tuple(
        Field(name, _kind(field), _without_choices(field.get("description", "")), name in required)
        for name, field in node.get("properties", {}).items()
    )


def _without_choices(about: str) -> str:
    """A description without the list of choices that only repeats the names that its kind has already.

    >>> _without_choices("Who sees it.\\n\\n* `PRIVATE` - PRIVATE\\n* `PUBLIC` - PUBLIC")
    'Who sees it.'
    """
    return _BARE_CHOICE.sub("", about).strip()


def _kind(node: Node) -> Kind:
    """A schema in words.

    >>> _kind({"type": ["number", "null"]}).text, _kind({"type": "string", "format": "date-time"}).text
    ('number or null', 'date-time')
    >>> _kind({"type": "array", "items": {"$ref": "#/components/schemas/Entry"}})
    Kind(text='list of Entry', shape='Entry')
    """
    if "$ref" in node:
        name = node["$ref"].rpartition("/")[2]
        return Kind(name, name)
    for several in ("oneOf", "anyOf", "allOf"):
        if several in node:
            kinds = [_kind(each) for each in node[several]]
            return Kind(
                " or ".join(kind.text for kind in kinds), next((k.shape for k in kinds if k.shape), "")
            )
    if "enum" in node:
        return Kind(" | ".join("null" if value is None else str(value) for value in node["enum"]))
    types = node.get("type", "")
    names = [types] if isinstance(types, str) else list(types)
    if names[0] == "array":
        items = _kind(node["items"])
        return Kind(f"list of {items.text}", items.shape)
    if node.get("format") in {"date-time", "uuid", "uri", "binary"}:
        names[0] = {"uri": "address", "binary": "file"}.get(node["format"], node["format"])
    return Kind(" or ".join(names))
