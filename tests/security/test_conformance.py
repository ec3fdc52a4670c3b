"""The API against its own schema: schemathesis makes up requests, right ones and wrong ones.

A few for each operation in the suite; with TSTTC_SCHEMATHESIS=200 in the environment so many of each kind.
"""

import gc
import json
import os
from collections.abc import Iterator
from typing import Any

import pytest
import schemathesis
from django.core.signals import request_finished, request_started
from django.db import close_old_connections
from hypothesis import HealthCheck, Phase, given
from hypothesis import settings as rules
from hypothesis.errors import Unsatisfiable
from pytest_django import Settings
from schemathesis import GenerationMode
from schemathesis.core.failures import Failure, FailureGroup

from leaderboard.models import ApiToken, Edition, Method, Submission, User
from leaderboard.wsgi import application
from tests import builders, openapi

N_REQUESTS = int(os.environ.get("TSTTC_SCHEMATHESIS", "3"))
MODES = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
# A made-up request that fits the schema may still name what there is not, or send what no grammar can tell.
NOT_ASKED = {"positive_data_acceptance", "negative_data_rejection"}


@pytest.fixture(autouse=True)
def one_connection() -> Iterator[None]:
    """The requests are made in the test's own transaction, so none may close its connection."""
    for signal in (request_started, request_finished):
        signal.disconnect(close_old_connections)
    yield
    for signal in (request_started, request_finished):
        signal.connect(close_old_connections)
    gc.collect()  # what is left open of these requests is not to be found by another test


@pytest.fixture
def schema(edition: Edition, owner: User, settings: Settings) -> schemathesis.BaseSchema:
    """The recorded schema, with the owner's world behind it."""
    settings.WAITERS = 0  # nobody waits a minute for made-up things
    scored = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    document = json.loads(openapi.text_of(openapi.schema()))
    for methods in document["paths"].values():
        for operation in methods.values():
            for parameter in operation.get("parameters", []):
                _give_what_there_is(parameter, scored)
    schema = schemathesis.openapi.from_dict(document)
    schema.app = application
    return schema


def _give_what_there_is(parameter: dict[str, Any], scored: Submission) -> None:
    """Half of the made-up identifiers ought to be of something."""
    there = {
        "submission_id": str(scored.pk),
        "method_id": str(scored.method_id),
        "split": "test",
        "number": 1,
    }
    if parameter["in"] == "path" and parameter["name"] in there:
        kind = parameter["schema"]
        parameter["schema"] = {"anyOf": [{"enum": [there[parameter["name"]]]}, kind]}


# A body that breaks off within a file leaves that file to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("is_signed_in", [True, False])
def test_every_answer_is_as_the_schema_says(
    schema: schemathesis.BaseSchema, owner: User, is_signed_in: bool
) -> None:
    token = builders.token(owner)
    # The client that calls the application directly takes compressed answers and does not unpack them.
    headers = {"Accept-Encoding": "identity"}
    headers |= {"Authorization": f"Bearer {token}"} if is_signed_in else {}
    excluded = [check for name in NOT_ASKED for check in schemathesis.checks.CHECKS.get_by_names([name])]
    names, faults = set(), []
    for result in schema.get_all_operations():
        operation = result.ok()
        names.add(operation.label)
        for mode in MODES:

            @rules(
                max_examples=N_REQUESTS,
                deadline=None,
                database=None,
                derandomize=N_REQUESTS < 10,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            @given(case=operation.as_strategy(mode))
            def ask(case: schemathesis.Case) -> None:
                case.call_and_validate(headers=headers, excluded_checks=excluded)

            try:
                ask()
            except Unsatisfiable:
                assert mode == GenerationMode.NEGATIVE, operation.label  # nothing can be said wrong here
            except (FailureGroup, Failure) as fault:
                faults.append(f"{operation.label}: {fault}")
    assert not faults, "\n\n".join(faults)
    assert len(names) > 15
    # Nothing that was made up did any harm.
    assert ApiToken.objects.filter(revoked_at=None).exists()
    assert Method.objects.filter(team__memberships__user=owner).exists()
