"""Log lines: ids in every line about a submission, and no secrets."""

import io
import json
import logging
import logging.config
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from django.conf import settings
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client

from leaderboard.models import Edition, User
from leaderboard.ops import logs
from leaderboard.storage import truth_values
from tests import builders

Lines = Callable[[], list[dict[str, Any]]]


@pytest.fixture
def written() -> Iterator[io.StringIO]:
    """All lines on standard error in production, ours and the libraries'."""
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(logs.formatter(as_json=True))
    root = logging.getLogger()
    root.addHandler(handler)
    yield stream
    root.removeHandler(handler)


@pytest.fixture
def lines(written: io.StringIO) -> Lines:
    """The lines so far, each parsed: a line that is no JSON fails the test."""
    return lambda: [json.loads(line) for line in written.getvalue().splitlines()]


@pytest.fixture
def opened(benchmark: None, tmp_path: Path, transactional_db: None) -> Edition:
    """The test split, open; its nudges really follow their commits."""
    return builders.import_truth(tmp_path)


def _send(token: str, data: bytes) -> Any:
    upload = SimpleUploadedFile("predictions.json", data, content_type="application/json")
    return Client(headers={"Authorization": f"Bearer {token}"}).post(
        "/api/v1/submissions",
        {"split": "test", "method": "Foo", "file": upload, "note": "call me at home@example.net"},
    )


def events(records: list[dict[str, Any]]) -> list[str]:
    return [line["event"] for line in records]


def test_every_line_from_upload_to_score_names_the_submission(
    opened: Edition, owner: User, lines: Lines
) -> None:
    sent = _send(builders.token(owner), builders.predictions(opened))
    submission_id = sent.json()["id"]
    assert builders.score_all() == 1
    records = lines()
    assert events(records) == [
        "evaluation_queued",
        "submission_received",
        "request_finished",
        "evaluation_finished",
    ]
    assert {line["request_id"] for line in records[:3]} == {sent.headers["X-Request-ID"]}
    [evaluation_id] = {line["evaluation_id"] for line in records if "evaluation_id" in line}
    for line in records:
        if line["event"] != "request_finished":
            assert line["submission_id"] == submission_id
        if line["event"].startswith("evaluation"):
            assert line["evaluation_id"] == evaluation_id
        assert {"level", "logger", "timestamp"} <= set(line)


@pytest.mark.slow
def test_no_secret_no_address_and_no_true_value_is_ever_written(
    opened: Edition, owner: User, written: io.StringIO
) -> None:
    token = builders.token(owner)
    assert _send(token, builders.predictions(opened)).status_code == 201
    assert _send(token, b'{"0": "nonsense"}').status_code == 201
    assert _send(token[:-1] + "x", b"{}").status_code == 401
    visitor = Client()
    visitor.post("/accounts/login/", {"login": owner.email, "password": "correct horse"})
    visitor.post("/accounts/login/", {"login": owner.email, "password": "wrong staple"})
    visitor.post("/accounts/password/reset/", {"email": owner.email})
    visitor.get("/accounts/confirm-email/MQ:1abcde:secret-key-of-the-mail/")
    visitor.get("/board/test/", {"q": "what.i.look@for.example"})
    builders.score_all()
    text = written.getvalue()
    assert text.count("evaluation_finished") == 2
    secrets = [token, token[8:], owner.email, "@", "correct horse", "wrong staple", "secret-key-of-the-mail"]
    assert [secret for secret in secrets if secret in text] == []
    truth = truth_values.load(opened.ground_truth_id)
    telling = [repr(float(value)) for value in truth.ttc_s if len(repr(float(value))) > 8]
    assert len(telling) > 100
    assert [value for value in telling if value[:8] in text] == []


@pytest.mark.parametrize("has_csrf_cookie", [False, True])
def test_secret_of_an_invitation_is_in_no_line_of_any_logger(
    has_csrf_cookie: bool, owner: User, written: io.StringIO
) -> None:
    secret = "OTU0bQ-canary_of-an_invitation"
    strict = Client(enforce_csrf_checks=True)
    strict.force_login(owner)
    if has_csrf_cookie:
        strict.get("/submit/")
    # Django itself logs the whole path of a POST that it turns away.
    assert strict.post(f"/team/join/{secret}/").status_code == 403
    strict.get(f"/team/join/{secret}/")
    Client().get(f"/accounts/login/?next=%2Fteam%2Fjoin%2F{secret}%2F")
    # What a server in front of Django, or an access log, would write.
    logging.getLogger("gunicorn.access").warning('"GET /team/join/%s/ HTTP/1.1" 200', secret)
    logging.getLogger("django.server").warning(
        '"POST /accounts/login/?next=%%2Fteam%%2Fjoin%%2F%s%%2F"', secret
    )
    text = written.getvalue()
    assert "django.security.csrf" in text
    assert "/team/join/[hidden]" in text
    assert secret not in text


def test_every_handler_of_the_real_configurations_takes_secrets_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(
        "PROMETHEUS_MULTIPROC_DIR", str(tmp_path)
    )  # else it makes one, and all tests after share it
    gunicorn = runpy.run_path(str(Path(settings.BASE_DIR) / "deploy/gunicorn.conf.py"))
    assert gunicorn["accesslog"] is None
    for configuration in (settings.LOGGING, gunicorn["logconfig_dict"]):
        formatters = logging.config.DictConfigurator(configuration)
        for handler in configuration["handlers"].values():
            made = formatters.configure_formatter(dict(configuration["formatters"][handler["formatter"]]))
            assert isinstance(made, logs.CleanFormatter)


# --- the last step: what slips in -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "hidden"),
    [
        ("Invalid token tsttc_" + "0123456789abcdef" * 4, "0123456789abcdef"),
        ("headers: Authorization: Bearer eyJhbGciOi.J9.x-y_z=", "eyJhbGciOi"),
        ("authorization: basic dXNlcjpwYXNz", "dXNlcjpwYXNz"),
        ("connecting to redis://:swordfish@cache:6379/0", "swordfish"),
        ("connecting to postgres://tsttc:sword%40fish@db/tsttc", "sword%40fish"),
        ("s3://AKIA:secret@bucket", "secret"),
        ("Key (email)=(ada.lovelace+ci@cs.example.ac.uk) already exists.", "ada.lovelace"),
        ("GET /accounts/password/reset/key/4-c2hhcmVk-abc/", "c2hhcmVk"),
        ("GET /accounts/confirm-email/MQ:1abc:xyz/", "1abc"),
    ],
)
@pytest.mark.parametrize("as_json", [True, False])
def test_secret_in_a_librarys_message_is_taken_out(as_json: bool, text: str, hidden: str) -> None:
    record = logging.LogRecord("some.library", logging.WARNING, __file__, 1, "%s", (text,), None)
    line = logs.formatter(as_json=as_json).format(record)
    assert hidden not in line
    assert "hidden]" in line
    assert not as_json or json.loads(line)["level"] == "warning"


@pytest.mark.parametrize("as_json", [True, False])
def test_traceback_is_written_without_local_variables(as_json: bool) -> None:
    def fail() -> None:
        predictions = "4.2424242"  # noqa: F841 - what a pretty traceback would print
        raise ValueError("no such account: ada@example.org")

    try:
        fail()
    except ValueError as fault:
        record = logging.LogRecord(
            "x", logging.ERROR, __file__, 1, "it failed", (), (type(fault), fault, fault.__traceback__)
        )
    line = logs.formatter(as_json=as_json).format(record)
    assert "ValueError: no such account: [address hidden]" in line
    assert "raise ValueError" in line
    assert "'4.2424242'" not in line


# --- what is worth a line -------------------------------------------------------------------------------


def test_probes_that_succeed_are_no_news(db: None, lines: Lines) -> None:
    for path in ("/healthz", "/metrics"):
        assert Client().get(path).status_code == 200
    assert lines() == []


def test_request_is_written_without_its_query(db: None, lines: Lines) -> None:
    Client().get("/healthzz", {"token": "swordfish"})
    [line] = lines()
    assert (line["request"], line["code"]) == ("GET /healthzz", 404)


def test_failure_of_a_page_is_one_line_with_its_traceback(
    db: None, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("leaderboard.web.monitoring.health.checks", lambda: 1 / 0)
    response = Client(raise_request_exception=False).get("/healthy")
    assert response.status_code == 500
    [line] = [line for line in lines() if line["level"] == "error"]
    assert line["event"] == "request_failed"
    assert "ZeroDivisionError" in line["exception"]
    assert line["request_id"] == response.headers["X-Request-ID"]
