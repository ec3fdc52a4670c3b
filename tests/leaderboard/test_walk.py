"""The way of a file: the modules whose functions run for it, from the form to the row of the board.

Whoever follows a file opens those that `docs/architecture.md` names at each step. The others serve every
request alike, or draw the page around the table. Left out are the tables, middleware and logs.
"""

import inspect
import random
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone

from evaluator.predictions import sandbox
from leaderboard.methods import visibility
from leaderboard.models import Edition, Method, User
from leaderboard.scoring import worker
from leaderboard.storage import manifests
from leaderboard.workers import backlog
from tests import builders, pages

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parents[2]
FOR_PROGRAMS = "leaderboard/api/submission_views.py"
"""The other door. A file comes through one of the two."""

LEFT_OUT = (
    *("leaderboard/models/", "leaderboard/web/middleware/", "leaderboard/api/middleware"),
    "leaderboard/ops/logs",
)


def test_the_map_names_the_modules_that_a_file_passes(
    signed_in: Client, owner: User, edition: Edition
) -> None:
    # What a process does once is no part of the way, so another file goes first.
    _walk(signed_in, owner, edition, factor=1.4)
    passed = _walk(signed_in, owner, edition, factor=1.1)
    steps = set(re.findall(r"`((?:leaderboard|evaluator)/[a-z_/]+\.py)`", _way())) - {FOR_PROGRAMS}
    beside = passed - steps
    assert steps <= passed, f"named, and not called: {sorted(steps - passed)}"
    assert len(steps) == _stated(r"these (\d+) modules") < 45
    assert len(beside) <= _stated(r"at most (\d+) more"), f"{len(beside)} more:\n" + "\n".join(sorted(beside))


def _way() -> str:
    """The section of the map."""
    return (
        (REPOSITORY / "docs/architecture.md").read_text().split("## The way of a file")[1].split("\n## ")[0]
    )


def _stated(pattern: str) -> int:
    """The number that the map states."""
    found = re.search(pattern, _way())
    assert found is not None
    return int(found[1])


def _walk(client: Client, owner: User, edition: Edition, *, factor: float) -> set[str]:
    """Send a file, score it, draw the board and read it. Returns the modules that the file passed."""
    data, method, rng = builders.predictions(edition, factor=factor), f"Times {factor}", random.Random(0)
    fields = {"split": "test", "method": method, "description": "", "paper_url": "", "code_url": ""}
    passed = set[str]()
    with _noted(passed):
        client.post("/submit/", {**fields, "file": SimpleUploadedFile("p.json", data, "application/json")})
        worker.run_next(rng=rng)
        # Again, since the child process in which the worker has read it is not looked into.
        sandbox.answer(data, manifest=manifests.load(edition.ground_truth.manifest_digest))
    now = timezone.now()
    visibility.change(method=Method.objects.get(name=method), visibility="PUBLIC", actor=owner, now=now)
    with _noted(passed):
        backlog.work_off(now=now, rng=rng)
        board = pages.get(client)
    assert method in board.text
    return {name for name in passed if not name.startswith(LEFT_OUT)}


@contextmanager
def _noted(passed: set[str]) -> Iterator[None]:
    """Note the files of ours in which a function is called; what runs when one is imported is none."""
    folders = tuple(f"{REPOSITORY}/{package}/" for package in ("leaderboard", "evaluator"))

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        # Functions have fast locals; bodies of modules and classes have none.
        if event == "call" and code.co_flags & inspect.CO_OPTIMIZED and code.co_filename.startswith(folders):
            passed.add(code.co_filename.removeprefix(f"{REPOSITORY}/"))

    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(None)
