"""The API reference."""

import json
from collections.abc import Iterator

import pytest
from django.test import Client
from django.urls import reverse

from evaluator.problems import PROBLEM_CODES
from leaderboard.errors.problem_codes import API_CODES
from tests import openapi, pages


def described() -> Iterator[tuple[str, dict[str, str]]]:
    """Every object and operation of the recorded schema, and what its fields or parameters mean."""
    schema = json.loads(openapi.GOLDEN.read_text(encoding="utf-8"))
    for name, node in schema["components"]["schemas"].items():
        fields = node.get("properties", {})
        if not fields:
            continue
        yield f"shape-{name}", {field: words(fields[field]) for field in fields}
    for methods in schema["paths"].values():
        for operation in methods.values():
            yield operation["operationId"], {p["name"]: words(p) for p in operation.get("parameters", [])}


def words(node: dict[str, str]) -> str:
    """A description as the page shows it: no backticks and bullets, and no choices that repeat names."""
    about = []
    for line in node["description"].replace("`", "").split("\n"):
        name, is_choice, label = line.removeprefix("* ").partition(" - ")
        if not line.startswith("* "):
            about.append(line)
        elif is_choice and name.replace("_", " ").lower() != label.lower():
            about.append(f"{name}: {label}.")
    return " ".join(" ".join(about).split())


def get(client: Client) -> pages.Element:
    return pages.get(client, "/docs/api/")


def operation_page(client: Client, operation_id: str) -> pages.Element:
    return pages.get(client, f"/docs/api/{operation_id}/").one("article")


def openapi_operations() -> list[dict[str, str]]:
    schema = json.loads(openapi.GOLDEN.read_text(encoding="utf-8"))
    return [operation for methods in schema["paths"].values() for operation in methods.values()]


@pytest.mark.slow
def test_every_operation_of_the_schema_is_described(client: Client, benchmark: None) -> None:
    schema = client.get(reverse("api-schema"), headers={"accept": "application/vnd.oai.openapi+json"}).json()
    table = get(client).one("table", class_="operations")
    rows = [tr for body in table.all("tbody") for tr in body.all("tr") if tr.all("td")]
    described = {f"{tr.all('code')[0].text} {tr.all('code')[1].text}" for tr in rows}
    assert described == {
        f"{method.upper()} {path}" for path, methods in schema["paths"].items() for method in methods
    }
    for operation in openapi_operations():
        page = operation_page(client, operation["operationId"])
        assert page.one("p", class_="operation").text in described
        assert page.one("h1").text in {tr.one("a").text for tr in rows}
        assert "409 Error" not in page.text
        assert "* " not in " ".join(cell.text for cell in page.all("td"))


@pytest.mark.slow
def test_every_field_and_parameter_is_on_the_page_with_its_description(
    client: Client, benchmark: None
) -> None:
    root = get(client)
    undescribed = []
    for section, fields in described():
        # On the page of an operation its parameters come before the fields of its objects.
        element = (
            root.one("section", **{"aria-labelledby": section})
            if section.startswith("shape-")
            else operation_page(client, section).one("section", class_="parameters")
        )
        rows = [cells for row in element.all("tr") if len(cells := row.all("td")) == 3]
        shown = {name: cells[2].text for cells in rows for name in cells[0].text.split(", ")}
        undescribed += [f"{section}: {name}" for name, about in fields.items() if shown.get(name) != about]
    assert undescribed == []


@pytest.mark.slow
def test_every_code_has_an_anchor_that_errors_lead_to(client: Client, benchmark: None) -> None:
    ids = {e.attributes["id"] for e in get(client).everything() if "id" in e.attributes}
    assert {f"problem-{code}" for code in (*API_CODES, *PROBLEM_CODES)} <= ids
    problem = client.get("/api/v1/nowhere").json()
    assert problem["type"].partition("#")[2] in ids
