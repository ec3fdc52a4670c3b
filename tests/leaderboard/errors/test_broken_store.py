"""A file store that is read-only, broken, or of another owner: one answer everywhere, and no error 500."""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from django.core.files.storage import filesystem
from django.core.files.uploadedfile import SimpleUploadedFile
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils.html import escape
from pytest_django import Settings

from leaderboard.errors import outages
from leaderboard.models import Edition, Evaluation, Submission, User
from leaderboard.storage import files, manifests
from tests import builders

BROKEN = [errno.EIO, errno.ESTALE, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTCONN, errno.ELOOP]

Break = Callable[[Settings], None]


@contextmanager
def broken_disk(fault: int) -> Iterator[None]:
    """Every opening, writing and renaming of a stored file fails."""

    def fail(*_: object, **__: object) -> object:
        raise OSError(fault, os.strerror(fault), "/srv/secret/place")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filesystem, "open", fail, raising=False)
        patch.setattr(tempfile, "mkstemp", fail)
        patch.setattr(os, "fsync", fail)
        yield


def _not_a_folder(settings: Settings) -> None:
    shutil.rmtree(settings.FILES_DIR)
    Path(settings.FILES_DIR).write_text("not a folder")


def _circle(settings: Settings) -> None:
    shutil.rmtree(settings.FILES_DIR)
    Path(settings.FILES_DIR).symlink_to(settings.FILES_DIR)


def _not_mounted(settings: Settings) -> None:
    shutil.rmtree(settings.FILES_DIR)


def _clients(user: User) -> tuple[Client, Client]:
    page = Client(raise_request_exception=False)
    page.force_login(user)
    api = Client(raise_request_exception=False, headers={"Authorization": f"Bearer {builders.token(user)}"})
    return page, api


def _form(data: bytes) -> dict[str, object]:
    return {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data)}


def _assert_away(answer: object, *, is_page: bool) -> None:
    status, text = answer.status_code, answer.content.decode()  # type: ignore[attr-defined]  # the client's own
    assert status == 503
    assert answer["Retry-After"] == "30"  # type: ignore[index]  # the client's own
    assert (escape(outages.STORE_AWAY.sentence) if is_page else outages.STORE_AWAY.sentence) in text
    assert "Traceback" not in text
    assert "/srv/secret" not in text
    if not is_page:
        assert answer.json()["code"] == "store-unavailable"  # type: ignore[attr-defined]  # the client's own


@pytest.mark.slow
@pytest.mark.parametrize("fault", BROKEN, ids=errno.errorcode.get)
def test_an_upload_to_a_broken_store_gets_503_on_page_and_api_and_leaves_no_row(
    edition: Edition, owner: User, fault: int, caplog: pytest.LogCaptureFixture
) -> None:
    page, api = _clients(owner)
    data = builders.predictions(edition)
    with broken_disk(fault):
        _assert_away(page.post("/submit/", _form(data)), is_page=True)
        _assert_away(api.post("/api/v1/submissions", _form(data)), is_page=False)
    assert not Submission.objects.exists()
    assert not Evaluation.objects.exists()
    assert not [record for record in caplog.records if record.exc_info], "an outage has no traceback"
    assert api.post("/api/v1/submissions", _form(data)).status_code == 201


@pytest.mark.slow
@pytest.mark.parametrize("breaking", [_not_a_folder, _circle])
def test_a_store_that_is_no_folder_gets_503(
    edition: Edition, owner: User, settings: Settings, breaking: Break
) -> None:
    page, api = _clients(owner)
    data = builders.predictions(edition)
    breaking(settings)
    _assert_away(page.post("/submit/", _form(data)), is_page=True)
    _assert_away(api.post("/api/v1/submissions", _form(data)), is_page=False)
    assert not Submission.objects.exists()


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("breaking", [_not_a_folder, _not_mounted, None])
def test_whatever_reads_from_a_broken_store_gets_503(
    edition: Edition, owner: User, settings: Settings, breaking: Break | None, tmp_path: Path
) -> None:
    page, api = _clients(owner)
    sent = api.post("/api/v1/submissions", _form(builders.predictions(edition))).json()  # type: ignore[attr-defined]  # the client's own
    manifests.load.cache_clear()
    addresses = [
        f"/api/v1/submissions/{sent['id']}/file",
        "/api/v1/splits/test/manifest",
        "/api/v1/splits/test/croissant",
    ]
    for address in addresses:
        answer = api.get(address)
        assert answer.status_code == 200
        assert b"".join(answer)
    with pytest.MonkeyPatch.context() as patch:
        if breaking is None:
            patch.setattr(filesystem, "open", _raise_stale, raising=False)
        else:
            breaking(settings)
        for address in addresses:
            _assert_away(api.get(address), is_page=False)
        _assert_away(page.get("/submit/template/test.json"), is_page=True)
        with pytest.raises(CommandError, match="file store"):
            call_command("archive", str(tmp_path / "archive"))


def _raise_stale(*_: object, **__: object) -> object:
    raise OSError(errno.ESTALE, os.strerror(errno.ESTALE))


def test_a_disk_that_fails_at_the_first_read_gets_503_before_an_answer_begins(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pread(*_: object) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "pread", pread)
    _, api = _clients(owner)
    _assert_away(api.get("/api/v1/splits/test/manifest"), is_page=False)


def test_a_machine_without_a_folder_for_unfinished_uploads_gets_503(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere() -> object:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr(tempfile, "TemporaryFile", nowhere)
    page, api = _clients(owner)
    _assert_away(page.post("/submit/", _form(b"{}")), is_page=True)
    _assert_away(api.post("/api/v1/submissions", _form(b"{}")), is_page=False)


def test_a_full_disk_stays_another_answer_and_an_absent_file_an_absent_one(
    db: None, settings: Settings
) -> None:
    with pytest.raises(FileNotFoundError):
        files.store().open("predictions/00/absent.json", "rb")
    with pytest.raises(files.StoreUnavailable):
        files.open_named("predictions/00/absent.json")
    with pytest.raises(OSError, match="No space"), files.answering():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
