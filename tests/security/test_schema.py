"""schemathesis: requests that the OpenAPI schema allows, and requests that it does not, as each role.

A few for each operation in the suite, 60 in the full mode; TSTTC_SCHEMATHESIS=200 asks for so many.
"""

import gc
import os
from collections.abc import Iterator
from typing import Any

import pytest
import schemathesis
from django.core.signals import request_finished, request_started
from django.db import close_old_connections, transaction
from hypothesis import HealthCheck, Phase, given, strategies
from hypothesis import settings as with_settings
from hypothesis.errors import Unsatisfiable
from pytest_django.fixtures import Settings
from schemathesis.core.failures import Failure, FailureGroup
from schemathesis.core.result import Ok
from schemathesis.generation import GenerationMode

from leaderboard.models import ApiToken
from leaderboard.wsgi import application
from tests.security.people import ADDRESS, World

pytestmark = pytest.mark.slow

WHOLE = os.environ.get("TSTTC_SECURITY_WHOLE") == "1"
EXAMPLES = int(os.environ.get("TSTTC_SCHEMATHESIS", "60" if WHOLE else "2"))
ROLES = ("anonymous", "stranger", "owner", "maintainer", "token without scope", "expired token")
# A made-up request that fits the schema may still name what there is not, or send what no grammar can tell.
NOT_CHECKED = ["positive_data_acceptance", "negative_data_rejection"]


def operations() -> Iterator[Any]:
    """Every operation of the schema, by its own account of itself."""
    schema = schemathesis.openapi.from_wsgi("/api/v1/schema", application)
    for operation in schema.get_all_operations():
        assert isinstance(operation, Ok), operation
        yield operation.ok()


@pytest.fixture(autouse=True)
def no_quotas(settings: Settings) -> None:
    settings.QUOTAS = False


@pytest.fixture(autouse=True)
def connection_stays() -> Iterator[None]:
    """Keep the connection's transaction open after a request, as Django's test client does."""
    for signal in (request_started, request_finished):
        signal.disconnect(close_old_connections)
    yield
    for signal in (request_started, request_finished):
        signal.connect(close_old_connections)


def headers_of(world: World, role: str, method: str) -> dict[str, str]:
    token = world.tokens.get(f"{role} {method}") or world.tokens.get(role)
    # The client that calls the application directly takes compressed answers and does not unpack them.
    return {"Accept-Encoding": "identity"} | ({"Authorization": f"Bearer {token}"} if token else {})


def ask(operation: Any, world: World, role: str, mode: GenerationMode) -> list[str]:
    """Requests of one role to one operation. Returns what is wrong with the answers."""
    wrong: list[str] = []
    known = {name: world.parameters()[name] for name in ("split", "number", "submission_id", "method_id")}
    there = {p.name: str(known[p.name]) for p in operation.path_parameters if p.name in known}
    headers = headers_of(world, role, operation.method.upper())
    excluded = schemathesis.checks.CHECKS.get_by_names(NOT_CHECKED)

    @with_settings(
        max_examples=EXAMPLES,
        deadline=None,
        derandomize=EXAMPLES < 10 or WHOLE,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode), is_there=strategies.booleans())
    def each(case: Any, is_there: bool) -> None:
        if is_there and mode is GenerationMode.POSITIVE:
            case.path_parameters = {**(case.path_parameters or {}), **there}
        with transaction.atomic():
            try:
                response = case.call_and_validate(
                    headers=headers, excluded_checks=excluded, environ_overrides={"REMOTE_ADDR": ADDRESS}
                )
                if not (is_sound(response) and ApiToken.objects.filter(revoked_at=None).exists()):
                    curl = case.as_curl_command()[:300]
                    wrong.append(f"{role} {operation.label} {response.status_code}: {curl}")
            except (FailureGroup, Failure) as fault:
                wrong.append(f"{role} {operation.label}: {fault}")
            transaction.set_rollback(True)

    each()
    return wrong


def is_sound(response: Any) -> bool:
    """No failure of ours; and what is refused is a problem that says why."""
    if response.status_code < 400:
        return True
    kind = response.headers.get("content-type", [""])[0]
    is_problem = kind.startswith("application/problem+json")
    return response.status_code < 500 and is_problem and bool(response.json()["problems"][0]["message"])


# The server that schemathesis brings leaves it to the garbage collector to close what was uploaded.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE])
def test_every_answer_to_made_up_requests_is_as_the_schema_says(world: World, mode: GenerationMode) -> None:
    wrong, n_operations = [], 0
    for operation in operations():
        n_operations += 1
        # Who may do nothing is refused before anything is read: nonsense is for those who may.
        for role in ROLES if WHOLE or mode is GenerationMode.POSITIVE else ("owner", "anonymous"):
            try:
                wrong += ask(operation, world, role, mode)
            except Unsatisfiable:
                assert mode is GenerationMode.NEGATIVE, (
                    operation.label
                )  # without parameters nothing can be wrong
    gc.collect()  # here, and not in the middle of another test
    assert not wrong, "\n".join(wrong[:20])
    assert n_operations >= 15
