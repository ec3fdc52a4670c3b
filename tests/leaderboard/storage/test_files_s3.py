"""The file store in an S3-compatible service: everything goes through it, and nothing past it."""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import boto3
import pytest
from django.core.exceptions import ImproperlyConfigured
from django.core.files.base import ContentFile
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone
from moto.server import ThreadedMotoServer
from pytest_django import Settings

from leaderboard.backups import contents
from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.ops import health
from leaderboard.storage import files, orphans, ownership, s3
from leaderboard.upkeep import store_check
from leaderboard.web.maintain import site_state
from tests import builders
from tests.prepared import REPOSITORY, put_sqlite
from tests.services import environment_of_its_own

BUCKET = "tsttc-test"


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """The endpoint of an S3 server on loopback."""
    running = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    yield f"http://{host}:{port}"
    running.stop()


@pytest.fixture
def bucket(server: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """An empty bucket, and its keys in the environment."""
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "the-key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "the-secret")
    made = boto3.resource("s3", endpoint_url=server, region_name="us-east-1").Bucket(BUCKET)
    made.create()
    yield made
    made.objects.all().delete()
    made.delete()


def at(endpoint: str) -> dict[str, Any]:
    """The setting of a store at this address."""
    url = f"s3://{BUCKET}/files?endpoint={endpoint}"
    return {"files": {"BACKEND": "leaderboard.storage.s3.S3FileStore", "OPTIONS": {"url": url}}}


@pytest.fixture
def stored(bucket: Any, server: str, settings: Settings) -> s3.S3FileStore:
    """The store that the application uses in this test."""
    settings.STORAGES = {**settings.STORAGES, **at(server)}
    store = files.store()
    assert isinstance(store, s3.S3FileStore)
    return store


@pytest.fixture
def nobody_answers(stored: s3.S3FileStore, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on, nothing listens where the store should be."""
    monkeypatch.setattr(s3, "CONNECT_TIMEOUT_S", 0.2)
    settings.STORAGES = {**settings.STORAGES, **at("http://127.0.0.1:1")}


def _names(bucket: Any) -> list[str]:
    return sorted(entry.key for entry in bucket.objects.all())


def _send(user: User, data: bytes) -> Any:
    token = builders.token(user)
    return Client(headers={"Authorization": f"Bearer {token}"}, raise_request_exception=False).post(
        "/api/v1/submissions",
        {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data)},
    )


# --- the journey ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_submission_is_scored_and_the_manifest_served_without_any_local_file(
    stored: s3.S3FileStore, bucket: Any, settings: Settings, benchmark: None, owner: User, tmp_path: Path
) -> None:
    edition = builders.import_truth(tmp_path)
    data = builders.predictions(edition)
    assert _send(owner, data).status_code == 201
    assert builders.score_all() == 1
    evaluation = Evaluation.objects.get()
    assert evaluation.status == Status.SCORED
    assert evaluation.scores.count() == 10
    manifest = Client().get("/api/v1/splits/test/manifest")
    text = b"".join(manifest.streaming_content)  # type: ignore[attr-defined]  # a FileResponse
    assert text.count(b"\n") == builders.N_SEQUENCES + 1
    assert int(manifest.headers["Content-Length"]) == len(text)
    assert not Path(settings.FILES_DIR).exists()
    assert [name.split("/")[:2] for name in _names(bucket)] == [
        ["files", "aligned"],
        ["files", "manifests"],
        ["files", "predictions"],
    ]


def test_same_bytes_are_one_object(stored: s3.S3FileStore, bucket: Any) -> None:
    upload = ContentFile(b'{"0": 1.5}', name="p.json")
    first = files.save_predictions(upload, now=timezone.now())
    assert files.save_predictions(upload, now=timezone.now()) == first
    assert _names(bucket) == [f"files/{files.predictions_name(first.digest)}"]
    with files.opened_predictions(first.digest) as kept:
        assert kept.read() == b'{"0": 1.5}'


def test_absent_object_is_an_absent_file(stored: s3.S3FileStore) -> None:
    assert not stored.exists("predictions/00/absent.json")
    for ask in (stored.size, stored.get_modified_time, stored.open):
        with pytest.raises(FileNotFoundError):
            ask("predictions/00/absent.json")


# --- when it is away ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_upload_while_the_store_is_away_is_answered_503_and_leaves_no_row(
    edition: Edition, owner: User, nobody_answers: None
) -> None:
    response = _send(owner, b'{"0": 1.5}')
    assert response.status_code == 503
    assert response.json()["code"] == "store-unavailable"
    assert "error on our side" in response.json()["detail"]
    assert int(response.headers["Retry-After"]) > 0
    assert "127.0.0.1:1/" not in response.text  # where the store is, is nobody's business
    assert not Submission.objects.exists()


def _fault_of_the_store(client: Client) -> tuple[bool, str]:
    """Whether health says that files can be stored, and what the maintainers' page says."""
    line = next(line for line in site_state.lines(now=timezone.now()) if line.name == "File store")
    return health.can_store(now=timezone.now()), " ".join([line.text, *line.reasons])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["away", "no bucket", "wrong key"])
def test_the_check_of_a_bucket_names_its_fault_until_it_works_again(
    stored: s3.S3FileStore,
    bucket: Any,
    server: str,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
    client: Client,
    db: None,
    kind: str,
) -> None:
    monkeypatch.setattr(s3, "CONNECT_TIMEOUT_S", 0.2)
    store_check.check(now=timezone.now())
    assert _fault_of_the_store(client)[0]
    assert _names(bucket) == [], "the check leaves nothing behind"
    with answering(403, "AccessDenied") as refusing:
        spoilt = {"away": "http://127.0.0.1:1", "no bucket": server, "wrong key": refusing}[kind]
        url = at(spoilt)["files"]["OPTIONS"]["url"]
        options = {"url": url.replace(BUCKET, "another-bucket") if kind == "no bucket" else url}
        settings.STORAGES = {
            **settings.STORAGES,
            "files": {**at(spoilt)["files"], "OPTIONS": options},
        }
        for _ in range(2):
            store_check.check(now=timezone.now())
    is_well, text = _fault_of_the_store(client)
    assert not is_well
    assert "files cannot be stored by the workers of" in text
    assert "2 times in" in text
    expected = {"away": "does not answer", "no bucket": "NoSuchBucket", "wrong key": "AccessDenied"}
    assert expected[kind] in text
    settings.STORAGES = {**settings.STORAGES, **at(server)}
    store_check.check(now=timezone.now())
    assert _fault_of_the_store(client)[0]


@contextmanager
def answering(status: int, code: str) -> Iterator[str]:
    """The address of a service that refuses everything as S3 does."""

    class Refusing(BaseHTTPRequestHandler):
        def do_PUT(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            body = f"<Error><Code>{code}</Code><Message>Refused</Message></Error>".encode()
            self.send_response(status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_GET = do_HEAD = do_DELETE = do_PUT  # noqa: N815 - the names that the library calls

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the library's own name
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Refusing) as running:
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()
        thread.join()


# --- faults are told as a disk would tell them ------------------------------------------------------------


def test_url_that_says_something_else_is_refused() -> None:
    for url in ("s3://", "http://bucket", "s3://bucket?endpiont=x", "s3:///folder", ""):
        with pytest.raises(ImproperlyConfigured, match="expected s3://bucket/folder"):
            s3.parsed(url)


def test_key_in_the_url_is_refused_and_not_repeated() -> None:
    with pytest.raises(ImproperlyConfigured) as caught:
        s3.parsed("s3://AKIAKEY:swordfish@bucket/folder")
    assert "AWS_SECRET_ACCESS_KEY" in str(caught.value)
    assert "swordfish" not in str(caught.value)


# --- cleaning up ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_orphan_in_the_bucket_is_listed_and_removed(stored: s3.S3FileStore, bucket: Any, db: None) -> None:
    kept = files.save_predictions(ContentFile(b'{"0": 1.5}', name="p.json"), now=timezone.now())
    assert list(orphans.orphans(now=timezone.now())) == []
    in_two_days = timezone.now() + timedelta(days=2)
    [orphan] = orphans.orphans(now=in_two_days)
    assert (orphan.digest, orphan.size_bytes) == (kept.digest, 10)
    assert not orphans.remove(orphan, now=timezone.now()), "written within the day"
    assert orphans.remove(orphan, now=in_two_days)
    assert _names(bucket) == [f"files/{ownership.NAME}"]


# --- backups --------------------------------------------------------------------------------------------

BACK_UP = """
import django; django.setup()
import sys
import boto3
from django.core.management import call_command
from django.db import connection
from leaderboard.models import User
truth, folder, new, endpoint, bucket = sys.argv[1:]
call_command("import_truth", "test", truth)
User.objects.create(email="ada@example.org")
call_command("backup", folder)
boto3.resource("s3", endpoint_url=endpoint).Bucket(bucket).objects.all().delete()
connection.close()
connection.settings_dict["NAME"] = new
assert "leaderboard_user" not in connection.introspection.table_names()
call_command("restore", folder)
print(User.objects.get().email)
call_command("restore", folder)
"""


@pytest.mark.slow
def test_an_sqlite_database_and_the_files_of_a_bucket_come_back_once(
    bucket: Any, server: str, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    put_sqlite(data / "leaderboard.sqlite3")
    folder = tmp_path / "backup"
    named = [REPOSITORY / "examples/truth.csv", folder, tmp_path / "new.sqlite3", server, BUCKET]
    done = subprocess.run(
        [sys.executable, "-c", BACK_UP, *map(str, named)],
        cwd=REPOSITORY,
        env=environment_of_its_own()
        | {"TSTTC_DATA_DIR": str(data), "TSTTC_FILES_URL": at(server)["files"]["OPTIONS"]["url"]}
        | {"DJANGO_SETTINGS_MODULE": "leaderboard.settings", "AWS_DEFAULT_REGION": "us-east-1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 board is the same byte for byte" in done.stdout, done.stderr
    assert "ada@example.org" in done.stdout, done.stderr
    assert "The database has users already" in done.stderr
    listed = json.loads((folder / contents.LIST).read_text())
    assert (listed["vendor"], listed["faults"]) == ("sqlite", {})
    assert folder.stat().st_mode & 0o077 == 0
    manifest, site = bucket.objects.all()
    assert site.key == f"files/{ownership.NAME}"
    assert manifest.key.startswith("files/manifests/")
    copy = folder / contents.FILES / manifest.key.removeprefix("files/")
    assert manifest.get()["Body"].read() == copy.read_bytes()


@pytest.mark.parametrize(
    ("url", "parts"),
    [
        ("s3://tsttc", ("tsttc", "", None, "us-east-1")),
        ("s3://tsttc/files/", ("tsttc", "files", None, "us-east-1")),
        (
            "s3://tsttc/files?endpoint=http://127.0.0.1:9000&region=eu-west-1",
            ("tsttc", "files", "http://127.0.0.1:9000", "eu-west-1"),
        ),
    ],
)
def test_an_address_has_bucket_folder_endpoint_and_region(
    url: str, parts: tuple[str, str, str | None, str]
) -> None:
    names = ("bucket_name", "location", "endpoint_url", "region_name")
    assert s3.parsed(url) == dict(zip(names, parts, strict=True))
