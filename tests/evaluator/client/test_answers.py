"""The answers that the client reads, compared with what the API's schema declares."""

from __future__ import annotations

import json
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import Any, get_type_hints

import msgspec
import pytest

from evaluator.client import answers
from evaluator.scoring.significance import Difference

SCHEMAS: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "golden" / "openapi.json").read_text(encoding="utf-8")
)["components"]["schemas"]
KINDS: dict[str, list[type]] = {
    "Account": [answers.Account],
    "Board": [answers.Board],
    "BoardPreview": [answers.BoardPreview],
    "Compared": [answers.Compared],
    "Difference": [Difference],
    "Entry": [answers.BoardEntry],
    "Method": [answers.Method],
    "Pair": [answers.Pair],
    "Quota": [answers.Quota],
    "RankChange": [answers.RankChange],
    "Submission": [answers.Submission],
    "Submitted": [answers.Submission],
    "Uncertainty": [answers.ConfidenceInterval],
    "VisibilityPreview": [answers.VisibilityPreview],
}
PAIRS = [(name, kind) for name, kinds in KINDS.items() for kind in kinds]
OWN = {"document", "is_new"}  # not of the answer


def names_of(kind: type) -> list[str]:
    if issubclass(kind, msgspec.Struct):
        return [name for name in kind.__struct_fields__ if name not in OWN]
    return [field.name for field in dataclass_fields(kind)]


def is_nullable(schema: dict[str, Any]) -> bool:
    of_type = schema.get("type")
    options = [*schema.get("oneOf", ()), *schema.get("anyOf", ())]
    return (
        of_type == "null"
        or (isinstance(of_type, list) and "null" in of_type)
        or any(map(is_nullable, options))
    )


@pytest.mark.parametrize(("name", "kind"), PAIRS, ids=[name for name, _ in PAIRS])
def test_every_field_that_the_api_may_leave_without_a_value_is_read(name: str, kind: type) -> None:
    properties, hints = SCHEMAS[name]["properties"], get_type_hints(kind)
    nullable = [each for each in names_of(kind) if each in properties and is_nullable(properties[each])]
    for each in nullable:
        assert msgspec.convert(None, hints[each]) is None, f"{name}.{each}"


@pytest.mark.parametrize(("name", "kind"), PAIRS, ids=[name for name, _ in PAIRS])
def test_every_field_that_the_client_needs_is_one_that_the_api_always_has(name: str, kind: type) -> None:
    assert issubclass(kind, msgspec.Struct) or kind is Difference
    if issubclass(kind, msgspec.Struct):
        needed = [
            each.name for each in msgspec.structs.fields(kind) if each.required and each.name not in OWN
        ]
        assert set(needed) <= set(SCHEMAS[name]["required"])


def test_every_kind_of_answer_is_compared_with_the_schema() -> None:
    structs = {
        each
        for each in vars(answers).values()
        if isinstance(each, type) and issubclass(each, msgspec.Struct) and each.__module__ == answers.__name__
    }
    assert structs - {kind for _, kind in PAIRS} == {answers.Queue}
