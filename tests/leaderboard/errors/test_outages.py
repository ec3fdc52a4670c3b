"""Failures beneath the leaderboard: every entry point answers clearly, and no file or row is half kept."""

import errno
import gc
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import psycopg
import pytest
from django.core.files.base import ContentFile
from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import InterfaceError, OperationalError, connection
from django.http import HttpResponse
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.errors import outages
from leaderboard.models import Edition, Evaluation, Method, Submission, User
from leaderboard.storage import files
from tests import builders


def sent(data: bytes, **fields: str) -> dict[str, object]:
    """A form as the page and the API take it."""
    return {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data), **fields}


@pytest.fixture
def page(owner: User) -> Callable[[bytes], HttpResponse]:
    """Submit through the page."""
    client = Client(raise_request_exception=False)
    client.force_login(owner)
    return lambda data: client.post("/submit/", sent(data))  # type: ignore[return-value]  # the test client's own


@pytest.fixture
def api(owner: User) -> Callable[[bytes], HttpResponse]:
    """Submit through the API."""
    client = Client(raise_request_exception=False)
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    return lambda data: client.post("/api/v1/submissions", sent(data), headers=headers)  # type: ignore[return-value]  # the test client's own


@contextmanager
def full_disk(fault: int = errno.ENOSPC) -> Iterator[None]:
    """Every flush to the disk says that there is no room."""

    def fsync(descriptor: int) -> None:
        raise OSError(fault, os.strerror(fault))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", fsync)
        yield


def assert_nothing_kept(settings: Settings) -> None:
    assert not Submission.objects.exists()
    assert not Evaluation.objects.exists()
    assert not Method.objects.exists()
    kept = [path for path in Path(settings.FILES_DIR).rglob("*") if path.is_file()]
    assert not [path for path in kept if "manifests" not in path.parts]


@pytest.mark.parametrize("fault", [errno.ENOSPC, errno.EDQUOT])
def test_full_disk_is_a_507_problem_and_leaves_nothing(
    edition: Edition, api: Callable[[bytes], HttpResponse], settings: Settings, fault: int
) -> None:
    with full_disk(fault):
        answer = api(builders.predictions(edition))
    assert answer.status_code == 507
    assert answer["Content-Type"] == "application/problem+json"
    body = answer.json()  # type: ignore[attr-defined]  # the test client's own
    assert (body["code"], body["status"]) == ("storage-full", 507)
    assert "file store is full" in body["detail"]
    assert_nothing_kept(settings)
    assert api(builders.predictions(edition)).status_code == 201


@contextmanager
def database_away(fault: type[Exception]) -> Iterator[None]:
    """Every question to the database is answered by the loss of the connection."""

    def refuse(*_: object) -> object:
        raise fault("server closed the connection unexpectedly")

    with connection.execute_wrapper(refuse):
        yield


@pytest.mark.parametrize("fault", [OperationalError, InterfaceError])
def test_absent_database_is_a_503_problem(
    edition: Edition, api: Callable[[bytes], HttpResponse], settings: Settings, fault: type[Exception]
) -> None:
    data = builders.predictions(edition)
    with database_away(fault):
        answer = api(data)
    assert answer.status_code == 503
    assert answer["Content-Type"] == "application/problem+json"
    assert answer["Retry-After"] == "5"
    assert answer.json()["code"] == "database-unavailable"  # type: ignore[attr-defined]  # the test client's own
    assert_nothing_kept(settings)


@pytest.mark.parametrize("address", ["/", "/board/test/", "/submissions/", "/docs/"])
def test_absent_database_is_a_503_page(edition: Edition, owner: User, address: str) -> None:
    client = Client(raise_request_exception=False)
    client.force_login(owner)
    with database_away(OperationalError):
        answer = client.get(address)
    assert answer.status_code == 503
    assert "The database does not answer at the moment" in answer.content.decode()


def test_a_database_without_room_is_a_full_store_and_not_an_absent_one() -> None:
    fault = OperationalError("could not extend file")
    fault.__cause__ = psycopg.errors.DiskFull("could not extend file")
    assert outages.outage_of(fault) == outages.STORAGE_FULL
    assert outages.outage_of(OperationalError("gone")) == outages.DATABASE_AWAY
    assert outages.outage_of(FileNotFoundError(errno.ENOENT, "no such file")) is None
    assert outages.outage_of(None) is None


# --- the store itself -------------------------------------------------------------------------------------


def test_file_is_flushed_before_it_is_renamed_and_its_directories_after(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[str] = []
    real_fsync, real_replace = os.fsync, Path.replace

    def fsync(descriptor: int) -> None:
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        events.append(
            f"flush {path.relative_to(settings.FILES_DIR).parts[:1]}" if path.is_file() else f"flush {path}"
        )
        real_fsync(descriptor)

    def replace(self: Path, target: Path) -> Path:
        events.append("rename")
        return real_replace(self, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", replace)
    kept = files.save_predictions(ContentFile(b"{}"), now=timezone.now())
    folder = Path(settings.FILES_DIR) / Path(files.predictions_name(kept.digest)).parent
    above = [folder, folder.parent, folder.parent.parent]
    assert events == ["flush ('.incoming',)", "rename", *(f"flush {path}" for path in above)]
    events.clear()
    assert files.save_predictions(ContentFile(b"{}"), now=timezone.now()) == kept
    assert events == [f"flush {path}" for path in above], (
        "known bytes are answered only once they are durable"
    )


def test_interrupted_upload_is_never_visible(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(self: Path, target: Path) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        files.save_predictions(ContentFile(b"{}"), now=timezone.now())
    assert not [path for path in Path(settings.FILES_DIR).rglob("*") if path.is_file()]


# --- uploads on their way in ------------------------------------------------------------------------------


class FullFile(io.BytesIO):
    """A file on a disk without room for more than ten bytes."""

    def write(self, data: bytes) -> int:  # type: ignore[override]  # narrower: nothing else is written here
        if self.tell() + len(data) > 10:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_upload_that_fills_the_disk_gives_its_room_back(
    edition: Edition, api: Callable[[bytes], HttpResponse], monkeypatch: pytest.MonkeyPatch
) -> None:
    full = FullFile()
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda: full)
    assert api(b"x" * 11).status_code == 507
    assert full.closed


BROKEN_AFTER_A_FILE = (
    b'--x\r\nContent-Disposition: form-data; name="file"; filename="p.json"\r\n\r\n{}\r\n'
    b"--x\r\nContent-Disposition: form-data; name=" + b"a" * 5000 + b"\r\n\r\n1\r\n--x--\r\n"
)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/api/v1/submissions", "/submit/"])
def test_upload_whose_request_cannot_be_read_on_gives_its_room_back(
    edition: Edition, owner: User, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[IO[bytes]] = []
    real = tempfile.TemporaryFile

    def remember() -> IO[bytes]:
        made.append(real())
        return made[-1]

    monkeypatch.setattr(tempfile, "TemporaryFile", remember)
    client = Client(raise_request_exception=False)
    client.force_login(owner)
    response = client.generic(
        "POST", path, BROKEN_AFTER_A_FILE, content_type="multipart/form-data; boundary=x"
    )
    assert 400 <= response.status_code < 500
    del response
    gc.collect()
    assert [file.closed for file in made] == [True]
