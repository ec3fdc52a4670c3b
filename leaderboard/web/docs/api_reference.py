"""The API's reference: the schema, arranged for a template, since the usual viewers break this site's CSP."""

import re
from functools import cache
from itertools import groupby
from typing import Any, Final

from django.utils.html import format_html, format_html_join
from drf_spectacular.generators import SchemaGenerator

from evaluator.problems import PROBLEM_CODES
from leaderboard.errors.problem_codes import API_CODES, API_GROUPS, STATUSES

Node = dict[str, Any]
# What drf-spectacular appends for each choice: its name, and its label.
_CHOICE: Final = re.compile(r"\s*^\* `([^`]+)` - (.+)$", re.MULTILINE)
GROUPS: Final = {
    "Submissions": {
        "submit": "Submit a file",
        "submission": "Get a submission",
        "list_submissions": "List your submissions",
        "submission_file": "Download a prediction file",
        "receipt": "Get the receipt of a score",
        "withdraw": "Withdraw a submission",
        "move": "Move a submission to another method",
    },
    "Splits and boards": {
        "list_splits": "List the splits",
        "manifest": "Get a manifest",
        "croissant": "Get a manifest as a dataset",
        "board": "Get a board",
        "compare": "Compare methods",
        "list_editions": "List the editions",
        "edition_board": "Get the board of an edition",
        "changelog": "List the changes of a board",
    },
    "Methods": {
        "list_methods": "List your methods",
        "method": "Get a method",
        "edit_method": "Edit a method",
        "preview_visibility": "Preview a publication",
        "show_method": "Publish a method",
    },
    "Account": {
        "account": "Get your account",
        "quota": "Get your quota",
        "revoke_token": "Revoke a token",
    },
    "Published results": {
        "list_published_tables": "List the published tables",
        "published_table": "Get a published table",
    },
    "Maintainers": {
        "edition_progress": "Get the progress of a re-scoring",
        "edition_preview": "Preview an edition",
    },
}
"""By the titles of the page: operations and what they do."""
_TITLES: Final = {name: title for group in GROUPS.values() for name, title in group.items()}


@cache
def reference() -> Node:
    """Return the context of `api_reference.html`, cached: the schema is constant in a process."""
    schema = SchemaGenerator().get_schema(request=None, public=True)
    named = schema["components"]["schemas"]
    schemas = _inline_enums(named, named)
    operations = [
        _operation(method.upper(), path, node, schemas, schema["components"]["responses"])
        for path, methods in _inline_enums(schema["paths"], named).items()
        for method, node in methods.items()
    ]
    by_id = {operation["id"]: operation for operation in operations}
    return {
        "operations": operations,
        "groups": [(title, [by_id[name] for name in names]) for title, names in GROUPS.items()],
        "objects": [_object(name, node) for name, node in schemas.items() if "properties" in node],
        "codes": [
            *(
                (title, [(code, STATUSES[code], about) for code, about in codes.items()])
                for title, codes in API_GROUPS.items()
            ),
            # In the report of a submission, which is no error of a request.
            (
                "Problems of a file",
                [(c, (), about) for c, about in PROBLEM_CODES.items() if c not in API_CODES],
            ),
        ],
    }


def _inline_enums(node: Any, named: Node) -> Any:
    """Replace references to anything but objects by their targets."""
    if isinstance(node, list):
        return [_inline_enums(each, named) for each in node]
    if not isinstance(node, dict):
        return node
    target = named.get(str(node.get("$ref", "")).rpartition("/")[2])
    if target is not None and "properties" not in target:
        # The field's own description goes before the enumeration's.
        return {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return {key: _inline_enums(value, named) for key, value in node.items()}


def _operation(method: str, path: str, node: Node, schemas: Node, shared: Node) -> Node:
    """Arrange one operation. Errors of every operation are references into `shared`."""
    parameters = sorted(node.get("parameters", []), key=lambda p: (p["in"] != "path", path.find(p["name"])))
    content = node.get("requestBody", {}).get("content", {})
    bodies = {media: schemas[_target(body["schema"])] for media, body in content.items()}
    return {
        "id": node["operationId"],
        "title": _TITLES[node["operationId"]],
        "name": f"{method} {path}",
        "method": method,
        "path": path,
        "about": node["description"],
        "needs_account": {} not in node.get("security", []),
        "parameters": [_field(p["name"], {**p, **p["schema"]}, p.get("required", False)) for p in parameters],
        "bodies": [(media, _fields(body)) for media, body in bodies.items()],
        "answers": [
            (status, _kind(schema), answer["description"])
            for status, answer in sorted(
                node["responses"].items(), key=lambda each: (each[0] != "201", each[0])
            )
            if status < "4"
            for schema in [next(iter(answer.get("content", {"": {}}).values())).get("schema", {})]
        ],
        "errors": [
            (status, (shared[_target(answer)] if "$ref" in answer else answer)["description"])
            for status, answer in sorted(node["responses"].items())
            if status >= "4"
        ],
        "objects": [_object(name, schemas[name]) for name in _objects_in(node, schemas)],
    }


def _object(name: str, node: Node) -> Node:
    return {"name": name, "about": node.get("description", ""), "fields": _fields(node)}


def _objects_in(node: Any, schemas: Node) -> list[str]:
    names: list[str] = []
    waiting = [node["responses"]]
    while waiting:
        each = waiting.pop(0)
        if isinstance(each, list):
            waiting[:0] = each
        elif isinstance(each, dict):
            name = _target(each) if "$ref" in each else ""
            if name in schemas and name not in names:
                names.append(name)
                waiting.append(schemas[name])
            waiting[:0] = [value for value in each.values() if isinstance(value, dict | list)]
    return names


def _fields(node: Node) -> list[Node]:
    """Arrange the fields of an object; successive ones of the same words are one row."""
    required = node.get("required", [])
    fields = [_field(name, field, name in required) for name, field in node.get("properties", {}).items()]
    groups = groupby(fields, key=lambda field: (field["kind"], field["about"], field["is_required"]))
    rows = [list(same) for _, same in groups]
    return [{**same[0], "name": ", ".join(each["name"] for each in same)} for same in rows]


def _field(name: str, node: Node, is_required: bool) -> Node:
    """Arrange a field or parameter."""
    about = _CHOICE.sub(_choice, node.get("description", "")).strip()
    return {"name": name, "kind": _kind(node), "about": about, "is_required": is_required}


def _choice(choice: re.Match[str]) -> str:
    """Say what a choice means, and nothing where it only repeats the name in the field's kind."""
    name, label = choice.groups()
    return "" if name.replace("_", " ").lower() == label.lower() else f" `{name}`: {label}."


def _target(node: Node) -> str:
    return str(node["$ref"]).rpartition("/")[2]


def _kind(node: Node) -> str:
    """Return a type as HTML; the name of an object links to its fields.

    >>> _kind({"type": ["number", "null"]}), _kind({"type": "string", "format": "date-time"})
    ('number or null', 'date-time')
    >>> _kind({"type": "array", "items": {"$ref": "#/components/schemas/Entry"}})
    'list of <a href="#shape-Entry">Entry</a>'
    """
    if "$ref" in node:
        return format_html('<a href="#shape-{0}">{0}</a>', _target(node))
    for several in ("oneOf", "anyOf", "allOf"):
        if several in node:
            return format_html_join(" or ", "{}", ((_kind(each),) for each in node[several]))
    if "enum" in node:
        return " | ".join("null" if value is None else str(value) for value in node["enum"])
    types = node.get("type", "any JSON value")
    names = [types] if isinstance(types, str) else list(types)
    if names[0] == "array":
        return format_html("list of {}", _kind(node["items"]))
    if node.get("format") in {"date-time", "uuid", "uri", "binary"}:
        names[0] = {"uri": "address", "binary": "file"}.get(node["format"], node["format"])
    return " or ".join(names)
