"""The API's schema: recorded, valid OpenAPI 3.1, and with a word for everything."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from drf_spectacular.validation import validate_schema

from tests import openapi


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json.loads(openapi.text_of(openapi.schema()))


def operations(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def test_schema_is_the_recorded_one(schema: dict[str, Any]) -> None:
    recorded = json.loads(openapi.GOLDEN.read_text(encoding="utf-8"))
    assert schema == recorded, (
        "The API's schema changed. If that is meant, and nothing is gone that programs use, record it: "
        "python -m tests.openapi"
    )


@pytest.mark.slow
def test_schema_is_valid_openapi_3_1_below_a_versioned_path(schema: dict[str, Any]) -> None:
    assert schema["openapi"].startswith("3.1")
    validate_schema(schema)
    assert all(path.startswith("/api/v1/") for path in schema["paths"])


def test_every_field_and_parameter_has_a_description(schema: dict[str, Any]) -> None:
    silent = [
        f"{shape}.{name}"
        for shape, node in schema["components"]["schemas"].items()
        for name, field in node.get("properties", {}).items()
        if not field.get("description")
    ]
    silent += [
        f"{where}: {parameter['name']}"
        for where, operation in operations(schema)
        for parameter in operation.get("parameters", [])
        if not parameter.get("description")
    ]
    assert silent == [], "describe them by help_text"


def test_every_operation_says_what_it_does_and_has_the_errors_that_all_have(schema: dict[str, Any]) -> None:
    names = []
    for where, operation in operations(schema):
        assert operation["description"], where
        assert {"400", "401", "403", "404", "406", "429", "503"} <= set(operation["responses"]), where
        names.append(operation["operationId"])
        for status, response in operation["responses"].items():
            if int(status) < 400 or "$ref" in response:
                continue
            assert list(response["content"]) == ["application/problem+json"], f"{where} {status}"
    assert len(names) == len(set(names))
