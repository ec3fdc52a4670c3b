"""Whatever file is sent: no answer is a failure of ours, and each says what is wrong with it."""

import json
import os
import re
import zlib
from typing import TYPE_CHECKING

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from pytest_django.fixtures import Settings

import evaluator
from leaderboard.models import Edition, Evaluation, Split, Status, Submission, User
from tests import builders, pages
from tests.evaluator.worlds import make_truth
from tests.security.hostile_files import LARGE_BYTES, corpus
from tests.security.people import browser_of, program_of

pytestmark = pytest.mark.slow

if TYPE_CHECKING:  # it lives in the stubs alone
    from django.test.client import _MonkeyPatchedWSGIResponse

CORPUS = dict(corpus())
TRUTH = make_truth([1.5 + n / 10 for n in range(40)])
NO_SHAPE = evaluator.Problem("shape", "It was read as something else")
READABLE = evaluator.write_predictions(manifest=TRUTH.manifest, ttc_s=TRUTH.ttc_s * 1.1)
WHOLE = os.environ.get("TSTTC_SECURITY_WHOLE") == "1"
# One of each kind goes the whole way in the suite: stored, queued, read in a child process, told to its team.
ALL_THE_WAY = (
    "whole: a space",
    "whole: 1,000,000 open brackets",
    "number: integer of 1,000,000 digits",
    "key: lone high surrogate",
    "shape: every key twice",
    "shape: 19.5 MB of empty objects",
    "encoding: utf-16",
)


@pytest.fixture
def good(edition: Edition) -> bytes:
    return builders.predictions(edition)


def sent(client: Client, path: str, name: str, data: bytes) -> "_MonkeyPatchedWSGIResponse":
    file = SimpleUploadedFile("predictions.json", data, content_type="application/json")
    return client.post(path, {"split": "test", "method": f"M {zlib.crc32(name.encode())}", "file": file})


def test_every_file_is_taken_or_refused_in_words(edition: Edition, owner: User, good: bytes) -> None:
    """Those of many megabytes go to a real web process; see test_web_alone.py."""
    browser, program = browser_of(owner), program_of(owner)
    for name, make in CORPUS.items():
        if "19.5 MB" in name:
            continue
        data = make(good)
        by_program = sent(program, "/api/v1/submissions", name, data)
        # The same bytes, and so the same submission.
        by_page = sent(browser, "/submit/", name, data)
        answer = json.loads(by_program.content)
        if len(data) >= LARGE_BYTES:
            assert (by_program.status_code, by_page.status_code) == (413, 413), name
            assert re.search(r"The file is [\d,]+ kB; expected at most", answer["detail"]), name
        elif not data:
            # A slip of the hand, which the page tells at once.
            assert (by_program.status_code, by_page.status_code) == (201, 422), name
        else:
            assert (by_program.status_code, by_page.status_code) == (201, 302), (name, answer)
            assert by_page.headers["Location"] == f"/submissions/{answer['id']}/", name


@pytest.mark.parametrize("name", [name for name in CORPUS if "30 MB" not in name])
def test_every_file_is_read_or_its_problems_are_reported(name: str) -> None:
    """In this process: the reader itself, without the child that it usually lives in."""
    data = CORPUS[name](READABLE)
    for problem in problems_of(data):
        assert problem.code
        assert problem.message.endswith("."), problem
        assert len(problem.message) < 600, problem
        assert problem.message.isprintable(), problem
        problem.message.encode()
        problem.where.encode()


def problems_of(data: bytes) -> tuple[evaluator.Problem, ...]:
    """What is wrong with a file; nothing if it is read."""
    try:
        predictions = evaluator.read_predictions(data, manifest=TRUTH.manifest)
    except evaluator.Rejected as rejected:
        return tuple(rejected.problems[:5])
    return () if predictions.ttc_s.shape == (TRUTH.manifest.n_sequences,) else (NO_SHAPE,)


@pytest.mark.parametrize("name", [n for n in CORPUS if "30 MB" not in n] if WHOLE else ALL_THE_WAY)
def test_a_worker_rejects_it_and_its_team_reads_why(
    edition: Edition, owner: User, good: bytes, name: str
) -> None:
    reject(owner, name, CORPUS[name](good))


def reject(owner: User, name: str, data: bytes) -> str:
    """Send a file, have it read, look at what its team sees. Returns the state it ended in."""
    Split.objects.update(quota_limit=None, quota_rejected_limit=None)
    submission = builders.submit(owner, data, method=f"M {zlib.crc32(name.encode())}", visibility="PRIVATE")
    builders.score_all()
    evaluation = Evaluation.objects.get(submission=submission)
    page = browser_of(owner).get(f"/submissions/{submission.pk}/")
    answer = program_of(owner).get(f"/api/v1/submissions/{submission.pk}")
    assert (page.status_code, answer.status_code) == (200, 200), name
    pages.page(page)
    if evaluation.status == Status.SCORED:
        return str(evaluation.status)
    assert evaluation.status == Status.REJECTED, (name, evaluation.last_error)
    assert evaluation.n_problems >= 1
    problems = json.loads(answer.content)["problems"]
    assert problems[0]["code"]
    assert problems[0]["message"].endswith(".")
    assert Submission.objects.filter(pk=submission.pk).exists()
    return str(evaluation.status)


FIELD = b"--x\r\nContent-Disposition: form-data; name=a\r\n\r\nb\r\n--x--"
BODIES = (
    ("multipart/form-data; boundary=x", b""),
    ("multipart/form-data; boundary=x", FIELD.replace(b"b\r\n", b"\xff\x00\xed\xa0\x80\r\n")),
    ("multipart/form-data; boundary=x", FIELD[:40]),
    ("multipart/form-data", b"--x--"),
    ("multipart/form-data; boundary=" + "x" * 300, b"--x--"),
    ('multipart/form-data; boundary="\x00"', b"--x--"),
    ("multipart/form-data; boundary=x; charset=nonsense", FIELD),
    ("multipart/form-data; boundary=x; charset=utf-7", FIELD),
    ("application/json", b"\xff\xfe{"),
    ("application/json", b"[" * 100_000),
    ("application/json", b"9" * 100_000),
    ("application/json", b'{"token": "\\ud800"}'),
    ("application/json; charset=nonsense", b"{}"),
    ("application/x-www-form-urlencoded", b"split=%ff%00&method=%ed%a0%80"),
    ("application/x-www-form-urlencoded", b"&".join(b"a%d=1" % n for n in range(5000))),
    ('text/plain; charset="', b"x"),
    ("", b"x"),
    ("\u00e9/\u00e9", b"x"),
)
POSTED = ("/api/v1/submissions", "/submit/", "/api/v1/tokens/revoke", "/accounts/login/", "/tokens/")


@pytest.mark.parametrize("path", POSTED)
def test_no_body_is_a_failure_of_ours(edition: Edition, owner: User, settings: Settings, path: str) -> None:
    settings.ACCOUNT_RATE_LIMITS = False
    for client in (Client(raise_request_exception=False), browser_of(owner), program_of(owner)):
        for content_type, body in BODIES:
            response = client.generic("POST", path, body, content_type=content_type)
            assert response.status_code < 500, (path, content_type, body[:50])
