"""Each operation of the API has a page with a request and the answer that the API gives to it."""

import json
import os
import re
import shlex
from pathlib import Path
from typing import Any

import click
import pytest
from django.test import Client
from django.utils import timezone
from pytest_django.fixtures import Settings

from evaluator.cli import main
from leaderboard.editions import corrections
from leaderboard.models import Edition, Split, User
from leaderboard.web.docs import api_reference
from leaderboard.web.docs.api_examples import DRAFT, EXAMPLES, METHOD, MISNAMED, OTHER, SITE, SUBMISSION
from tests import api_examples as sent
from tests import builders
from tests.leaderboard.web.test_every_page import assert_sound

OPERATIONS = [operation["id"] for operation in api_reference.reference()["operations"]]

METHODS = (("Deep TTC", 1.05, METHOD), ("Box height", 1.2, OTHER), ("Draft net", 1.1, DRAFT))


@pytest.fixture
def answers(
    benchmark: None, owner: User, maintainer: User, tmp_path: Path, settings: Settings
) -> dict[str, Any]:
    """Every example's answers, from a small world of three methods and a draft edition."""
    settings.SITE_URL = SITE
    edition = builders.import_truth(tmp_path, split="val")
    Split.objects.filter(pk="val").update(quota_limit=50)
    known = {}
    for name, factor, example in METHODS:
        seen_by = "PRIVATE" if example == DRAFT else "PUBLIC"
        data = builders.predictions(edition, factor=factor)
        made = builders.submit(owner, data, method=name, split="val", visibility=seen_by)
        known[str(made.method_id)] = example
        if example in {METHOD, DRAFT}:
            known[str(made.pk)] = SUBMISSION if example == METHOD else MISNAMED
    builders.score_all()
    builders.infer_all()
    # Comparing is asked for once, and answered when a worker has done it.
    mine = {example: real for real, example in known.items()}
    Client().get(f"/api/v1/compare?split=val&m={mine[METHOD]}&m={mine[OTHER]}")
    builders.infer_all()

    def prepare(operation: str) -> None:
        if operation == "edition_progress":
            open_draft(tmp_path)

    clients = {name: asking(user) for name, user in (("owner", owner), ("maintainer", maintainer))}
    file = builders.predictions(edition, factor=1.02)
    return sent.answers(clients, known, file=file, prepare=prepare)


def asking(user: User) -> Client:
    """A client, and the header with a token of that person."""
    client = Client(raise_request_exception=False)
    client.headers_of_token = {"Authorization": f"Bearer {builders.token(user)}"}  # type: ignore[attr-defined]
    return client


def open_draft(tmp_path: Path) -> Edition:
    """A draft edition of val without one recording, with everything re-scored."""
    lines = (tmp_path / "truth-val.csv").read_text().splitlines()
    path = tmp_path / "corrected.csv"
    path.write_text("\n".join(line for line in lines if ",0001," not in line) + "\n")
    now = timezone.now()
    opened = corrections.open_edition(split_name="val", path=path, protocol=None, now=now, actor=None)
    builders.score_all()
    builders.infer_all()
    return opened


@pytest.mark.slow
def test_every_example_is_answered_as_it_is_recorded(answers: dict[str, Any]) -> None:
    if os.environ.get(sent.RECORD):
        sent.ANSWERS.write_text(json.dumps(answers, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    recorded = json.loads(sent.ANSWERS.read_text(encoding="utf-8"))
    assert answers == recorded, "If that is meant: python -m tests.api_examples"
    for name, each in recorded.items():
        assert each["answer"]["status"].startswith("2"), name
        assert each["refused"]["status"].startswith("4"), name


def test_every_operation_has_an_example_of_its_own_path(client: Client) -> None:
    assert sorted(EXAMPLES) == sorted(OPERATIONS)
    for operation in api_reference.reference()["operations"]:
        call = EXAMPLES[operation["id"]].call
        pattern = re.sub(r"\{\w+\}", "[^/]+", operation["path"])
        assert call.method == operation["method"]
        assert re.fullmatch(pattern, call.path), call.path
        known = {parameter["name"] for parameter in operation["parameters"]}
        assert {name for name, _ in call.query} <= known
        assert operation["needs_account"] <= call.has_token


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_has_a_page_with_a_request_an_answer_and_an_error(
    client: Client, benchmark: None, name: str, settings: Settings
) -> None:
    settings.SITE_URL = "https://elsewhere.example"
    root = assert_sound(client.get(f"/docs/api/{name}/"))
    blocks = [pre.raw_text for pre in root.all("pre")]
    assert blocks[0].startswith("curl ")
    assert "https://elsewhere.example/api/v1/" in blocks[0]
    assert json.loads(sent.ANSWERS.read_text())[name]["refused"]["body"]["code"] in blocks[-1]
    assert not any(SITE in block for block in blocks)
    codes = [a.attributes["href"] for a in root.all("a") if "#problem-" in a.attributes["href"]]
    assert len(codes) == 1


@pytest.mark.parametrize("name", [name for name, example in EXAMPLES.items() if example.command])
def test_the_command_of_an_example_is_one_that_tsttc_knows(name: str) -> None:
    program, command, *arguments = shlex.split(EXAMPLES[name].command)
    assert program == "tsttc"
    click_command = main.get_command(click.Context(main), command)
    assert click_command is not None, command
    options = {option for parameter in click_command.params for option in parameter.opts}
    assert {argument for argument in arguments if argument.startswith("--")} <= options
