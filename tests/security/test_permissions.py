"""The permission matrix: what each role is answered at every address, by `tests/security/matrix.py`."""

import json
import re
from typing import Any

import pytest
from django.db import transaction
from django.http import HttpResponse, HttpResponseBase, StreamingHttpResponse

from tests.security.admin_matrix import admin_line
from tests.security.matrix import LINES, ROLES, Line
from tests.security.people import ABSENT, World, ask
from tests.security.routes import Route, operations, routes

pytestmark = pytest.mark.slow

METHODS = ("GET", "POST", "PUT", "PATCH", "DELETE")
# What a method that a line does not name may be answered; anything else would do something.
REFUSALS = {"401", "403", "404", "405", "in"}
# allauth takes any method for a form without a single field, which it shows again or sends away.
EMPTY_FORM = {"200", "302"}
SIGN_IN = re.compile(r"^/(?:accounts|admin)/login/\?next=")
RANDOM = re.compile(rb'name="csrfmiddlewaretoken" value="[^"]+"')


def line_of(route: Route) -> Line | None:
    return admin_line(route) if route.is_admin else LINES.get(route.name)


def address(route: Route, world: World, line: Line, *, absent: bool = False) -> str:
    """The route's address with its parameters filled in; `absent` names things that there are not."""
    values = {**world.parameters(), **line.at}
    values = {name: value(world) if callable(value) else value for name, value in values.items()}
    if absent:
        values |= {name: ABSENT for name in values if name.endswith("_id")}
    return route.filled(values)


def answer(response: HttpResponseBase) -> str:
    """A status as the table has it."""
    if response.status_code == 302 and SIGN_IN.match(response.headers["Location"]):
        return "in"
    return str(response.status_code)


def once(world: World, role: str, method: str, path: str, line: Line, **options: Any) -> HttpResponse:
    """One request, all of whose traces are gone afterwards."""
    with transaction.atomic():
        sends = json.dumps(line.sends) if line.is_json else dict(line.sends)
        client = world.client(role, method=method, **options)
        response = ask(client, method, path, sends=sends, is_json=line.is_json)
        if isinstance(response, StreamingHttpResponse):
            whole = response.getvalue()
            response = HttpResponse(whole, status=response.status_code, headers=dict(response.headers))
        transaction.set_rollback(True)
    assert isinstance(response, HttpResponse), response
    return response


def suggestion(route: Route, world: World) -> str:
    """What a route answers now, as a line of the table; a person has to judge whether that is right."""
    bare = Line({})
    try:
        path = address(route, world, bare)
    except KeyError as missing:
        return f"{route.name!r}: … has the parameter {missing}; say with at= what it stands for"
    outcomes = {
        method: " ".join(
            answer(once(world, role, method, path, bare, as_program=route.is_api)) for role in ROLES
        )
        for method in METHODS
    }
    asked = [f'{method}="{text}"' for method, text in outcomes.items() if not set(text.split()) <= REFUSALS]
    return f'"{route.name}": line({", ".join(asked)}),'


def test_every_route_has_a_line_and_every_line_a_route(world: World) -> None:
    all_routes = routes()
    assert len(all_routes) > 100
    without = [suggestion(route, world) for route in all_routes if line_of(route) is None]
    assert not without, "\n".join(["add to tests/security/matrix.py, if it is right:", *without])
    assert set(LINES) - {route.name for route in all_routes} == set()


def test_every_operation_of_the_schema_has_an_answer_and_every_answer_an_operation() -> None:
    by_path = {route.described_as: route for route in routes() if route.is_api}
    described = {by_path[path].name: set(methods) for path, methods in operations().items()}
    undescribed = {"api-schema", "api-docs", "api-root"}
    lines = {
        name: set(line.answers) for name, line in LINES.items() if name in {r.name for r in by_path.values()}
    }
    assert {name: methods for name, methods in lines.items() if name not in undescribed} == described


def test_every_route_answers_each_role_as_its_line_says(world: World) -> None:
    wrong, n_asked = [], 0
    for route in routes():
        line = line_of(route)
        if line is None:
            continue
        path = address(route, world, line)
        for method in line.answers:
            for role, expected in zip(ROLES, line.answers[method], strict=True):
                ways = (True, False) if route.is_api and role in world.users else (False,)
                for as_program in ways:
                    actual = answer(once(world, role, method, path, line, as_program=as_program))
                    n_asked += 1
                    if actual != expected:
                        how = "program" if as_program else "visitor"
                        wrong.append(f"{route.name} {method} {role} ({how}): {actual}, expected {expected}")
    assert not wrong, "\n".join(wrong)
    assert n_asked > 1000


def test_a_method_that_a_line_does_not_name_is_refused_to_everybody(world: World) -> None:
    done = []
    for route in routes():
        line = line_of(route)
        if line is None:
            continue
        path = address(route, world, line)
        for method in METHODS:
            if method in line.answers or route.is_admin:
                continue
            allowed = REFUSALS | EMPTY_FORM if route.name.startswith(("account_", "mfa_")) else REFUSALS
            for role in ("owner", "maintainer"):
                actual = answer(once(world, role, method, path, line, as_program=route.is_api))
                if actual not in allowed:
                    done.append(f"{route.name} {method} {role}: {actual}")
    assert not done, "\n".join(done)


def test_what_is_forbidden_looks_like_what_is_not_there(world: World) -> None:
    differing, n_compared = [], 0
    for route in routes():
        line = line_of(route)
        if line is None or route.is_admin or not any(name.endswith("_id") for name in route.parameters):
            continue
        for method, answers in line.answers.items():
            for role, expected in zip(ROLES, answers, strict=True):
                if expected != "404":
                    continue
                n_compared += 1
                real, none = (
                    once(
                        world,
                        role,
                        method,
                        address(route, world, line, absent=absent),
                        line,
                        as_program=route.is_api,
                    )
                    for absent in (False, True)
                )
                assert isinstance(real, HttpResponse)
                if seen(real) != seen(none):
                    differing.append(f"{route.name} {method} {role}")
    assert not differing, "\n".join(differing)
    assert n_compared > 5


def seen(response: HttpResponse) -> tuple[int, bytes, dict[str, str]]:
    """What a reader gets, without what is random in every answer."""
    headers = {name: value for name, value in response.headers.items() if name != "X-Request-ID"}
    return response.status_code, RANDOM.sub(b"", response.content), headers
