"""Values of the ground truth turn up nowhere but in the workers' private directory."""

import io
import logging
import random
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from django.core.management import call_command
from django.db import connection
from django.test import Client
from django.utils import timezone
from kombu import Connection
from pytest_django.fixtures import Settings

import evaluator
from leaderboard.editions import corrections, ground_truth, splits
from leaderboard.models import Edition, Evaluation, Split, Status, User
from leaderboard.ops import broker as broker_verbs
from leaderboard.ops import logs
from leaderboard.queue import worker
from leaderboard.storage import truth_values
from leaderboard.upkeep import pollers
from tests import builders
from tests.security import canaries
from tests.security.canaries import Search
from tests.security.crawler import crawl
from tests.security.routes import routes

pytestmark = pytest.mark.slow

RNG = random.Random(0)


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """Every line at every level, as it would be written."""
    written = io.StringIO()
    handler = logging.StreamHandler(written)
    handler.setFormatter(logs.formatter(as_json=True))
    root = logging.getLogger()
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.DEBUG)
    yield written
    root.removeHandler(handler)
    root.setLevel(level)


@pytest.fixture
def broker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A broker made of files, whose messages nobody takes."""
    folder = tmp_path / "broker"
    folder.mkdir()
    options = dict.fromkeys(("data_folder_in", "data_folder_out", "control_folder"), str(folder))
    pool = Connection("filesystem://", transport_options=options).Pool(4)
    monkeypatch.setattr(broker_verbs, "_connections", lambda: pool)
    return folder


@pytest.mark.parametrize("value", [3.7182818459045091, -13.100000000000371, 0.4000000123456789])
def test_the_search_finds_each_form_of_each_canary(value: float) -> None:
    search = Search([value])
    all_forms = list(canaries.forms([value]))
    assert len(all_forms) == 1 + 2 * (3 + 6)
    for form, pattern in all_forms:
        for around in (0, 1, 5, 8, 13):
            data = bytes(around) + pattern + b"xyz" + bytes(around)
            assert form in {how for _, how, _ in search.in_bytes(data, where="here")}, form
    assert search.in_bytes(b"nothing at all 3.71 and more of it" * 50, where="here") == []


@pytest.mark.django_db(transaction=True)
def test_no_value_leaves_the_private_directory(
    tmp_path: Path,
    settings: Settings,
    log: io.StringIO,
    broker: Path,
) -> None:
    """Submit, score, reject, fail, re-score, preview, publish, infer: pages, API, administration, worker."""
    settings.BACKOFF_S = 0.0
    settings.ACCOUNT_RATE_LIMITS = False
    splits.ensure_splits()
    values = canaries.plant(tmp_path / "truth.csv")
    table = tmp_path / "truth.csv"
    edition = ground_truth.import_truth(split_name="test", path=table, now=timezone.now())
    table.rename(settings.GROUND_TRUTH_DIR / "truth.csv")
    Split.objects.update(quota_limit=None, quota_rejected_limit=None, quota_min_gap=timedelta(0))
    people = [
        User.objects.create_user("owner@example.org", "correct horse", name="Owls"),
        User.objects.create_superuser("keeper@example.org", "correct horse", name="Keepers"),
    ]
    _live(edition, people[0])
    second = _correct(edition, settings.GROUND_TRUTH_DIR, people[1])
    seen = _look(people)
    corrections.publish(edition=second, reason="Labels.", now=timezone.now(), actor=people[1], replaces=1)
    builders.infer_all()
    pollers.sweep(rng=RNG)
    seen |= {f"after {where}": body for where, body in _look(people).items()}
    call_command("archive", str(tmp_path / "archive"))
    haystacks = {
        **seen,
        "log": log.getvalue().encode(),
        "database": _database(tmp_path),
        **canaries.files_below(tmp_path, but=settings.GROUND_TRUTH_DIR),
    }
    messages = [name for name in haystacks if name.startswith("broker/")]
    assert set(Evaluation.objects.values_list("status", flat=True)) >= {"SCORED", "REJECTED", "SYSTEM_ERROR"}
    assert len(messages) > 5
    assert "archive/boards/test/edition-2.csv" in haystacks
    assert len(seen) > 150
    assert len(haystacks["log"]) > 10_000
    assert Search(values).in_all(haystacks) == []
    # The search is able to: here they are.
    private = canaries.files_below(settings.GROUND_TRUTH_DIR, but=tmp_path / "nowhere")
    assert Search(values).in_all(private)


def _live(edition: Edition, owner: User) -> None:
    """Files that are scored, rejected, and given up."""
    browser = Client()
    browser.force_login(owner)
    program = Client(headers={"Authorization": f"Bearer {builders.token(owner)}"})
    good = [builders.predictions(edition, factor=factor) for factor in (1.07, 1.21, 1.33)]
    bad = good[0].replace(b'"7":', b'"7000":').replace(b'"9":', b'"9":"', 1)
    for client, path in ((browser, "/submit/"), (program, "/api/v1/submissions")):
        for number, data in enumerate((*good[:2], bad, good[0][:-400], b"{}")):
            form = {"split": "test", "method": f"M {number}", "file": io.BytesIO(data + b" " * number)}
            assert client.post(path, form).status_code in {200, 201, 302}
    builders.score_all()
    # Ours: the values cannot be read, every time.
    values = truth_values.values_path(edition.ground_truth_id)
    kept = values.read_bytes()
    for damage in (kept[:-200], kept[:300], b"no archive"):
        values.write_bytes(damage)
        truth_values.load.cache_clear()
        # Other bytes each time, which the same bytes again would not be a submission for.
        file = io.BytesIO(good[2] + b" " * (len(damage) % 97))
        form = {"split": "test", "method": "Given up", "file": file}
        assert program.post("/api/v1/submissions", form).status_code in {200, 201}
        for _ in range(40):
            if not worker.run_next(rng=RNG):
                break
    values.write_bytes(kept)
    truth_values.load.cache_clear()
    assert Evaluation.objects.filter(status=Status.SYSTEM_ERROR).exists()
    builders.infer_all()


def _correct(edition: Edition, private: Path, keeper: User) -> Edition:
    """A second edition next to the board, all of it scored, after two refused corrections."""
    path = private / "corrected.csv"
    canaries.corrected(private / "truth.csv", to=path)
    table = path.read_text().splitlines()
    of_zero = [*table[:-1], table[-1].rpartition(",")[0] + ",0.0"]

    def open_edition(path: Path) -> Edition:
        return corrections.open_edition(
            split_name="test", path=path, protocol=None, now=timezone.now(), actor=keeper
        )

    for name, lines in (("twice.csv", [*table, table[40]]), ("zero.csv", of_zero)):
        (private / name).write_text("\n".join(lines) + "\n")
        with pytest.raises(evaluator.Rejected):
            open_edition(private / name)
    opened = open_edition(path)
    builders.score_all()
    builders.infer_all()
    return opened


def _look(people: list[User]) -> dict[str, bytes]:
    """Every page, table and document that visitors, the owner and a maintainer come to by following links."""
    plain = ["/" + route.pattern for route in routes() if not route.parameters and "(" not in route.pattern]
    start = [f"/api/v1/splits/test/{name}" for name in ("board", "manifest", "editions", "changelog")]
    for pk in Evaluation.objects.values_list("submission", flat=True):
        start += [f"/api/v1/submissions/{pk}", f"/submissions/{pk}/"]
    start += [path for path in plain if "logout" not in path]
    bodies: dict[str, bytes] = {}
    for user in (None, *people):
        client = Client(raise_request_exception=False)
        if user is not None:
            client.force_login(user)

        def get(path: str, client: Client = client) -> bytes:
            response = client.get(path)
            body = response.getvalue() if response.streaming else response.content
            return body + repr(response.headers).encode()

        limit = 160 if user is not None and user.is_staff else 90
        bodies |= {f"{user} {path}": body for path, body in crawl(get, start=start, limit=limit).items()}
    return bodies


def _database(directory: Path) -> bytes:
    if connection.vendor != "sqlite":
        pytest.skip("the dump of PostgreSQL is looked through in test_from_file_to_rank.py")
    path = directory / "copy.sqlite3"
    with connection.cursor() as cursor:
        cursor.execute("VACUUM INTO %s", [str(path)])
    data = path.read_bytes()
    path.unlink()
    return data
