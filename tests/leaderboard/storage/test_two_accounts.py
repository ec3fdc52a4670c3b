"""Web and workers as two accounts with one group, in the folders of the installation: as root, on Linux."""

import encodings.cp437  # noqa: F401 - of zip files: another account may not read our libraries later
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from django.core.files.base import ContentFile

import evaluator
from leaderboard.storage import files, seeds, truth_values
from tests import builders
from tests.services import REPOSITORY

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root has other accounts"),
]
NOW = datetime(2026, 1, 1, tzinfo=UTC)
# Numbers that nobody has.
NUMBERS = {"root": 0, "tsttc": 64_101, "tsttc-web": 64_102, "tsttc-files": 64_103}
FORK = multiprocessing.get_context("fork")


def _run(account: str, act: Callable[[], Any], answer: Any) -> None:
    os.setgroups([NUMBERS["tsttc-files"]])
    os.setresgid(*[NUMBERS[account]] * 3)
    os.setresuid(*[NUMBERS[account]] * 3)
    os.umask(0o007)  # as in the units
    answer.send(act())


def as_account(account: str, act: Callable[[], Any]) -> Any:
    """What a process of this account answers; `EOFError` if it fails, which it says to standard error."""
    here, there = FORK.Pipe(duplex=False)
    child = FORK.Process(target=_run, args=(account, act, there))
    child.start()
    there.close()
    try:
        return here.recv()
    finally:
        child.join()
        here.close()


@dataclass(frozen=True)
class Host:
    """A machine after the installation, as far as folders go."""

    root: Path
    truth: evaluator.GroundTruth

    @property
    def private(self) -> Path:
        return self.root / "var/lib/tsttc/ground-truth"


@pytest.fixture
def host(settings: Any) -> Iterator[Host]:
    """Folders as docs/operations.md makes them, below one that anybody may enter."""
    root = Path(tempfile.mkdtemp(prefix="tsttc-host-"))
    root.chmod(0o755)
    page = (REPOSITORY / "docs/operations.md").read_text()
    lines = re.findall(r"^install -d -o (\S+) -g (\S+) -m (\d+) (.*)$", page, re.MULTILINE)
    assert len(lines) == 4
    for owner, group, mode, paths in lines:
        for path in paths.split():
            folder = root / path.lstrip("/")
            folder.mkdir(parents=True)
            os.chown(folder, NUMBERS[owner], NUMBERS[group])
            folder.chmod(int(mode, 8))
    settings.FILES_DIR = root / "var/lib/tsttc/files"
    settings.GROUND_TRUTH_DIR = root / "var/lib/tsttc/ground-truth"
    options = {"OPTIONS": settings.STORAGES["files"]["OPTIONS"] | {"location": str(settings.FILES_DIR)}}
    settings.STORAGES = settings.STORAGES | {"files": settings.STORAGES["files"] | options}
    truth = evaluator.read_truth(builders.truth_csv(root / "truth.csv"))
    try:
        yield Host(root=root, truth=truth)
    finally:
        shutil.rmtree(root)


def test_what_the_web_process_is_sent_is_scored_by_a_worker_and_what_workers_write_is_read_by_both(
    host: Host,
) -> None:
    truth = host.truth
    data = evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * 1.1)

    def imported() -> None:
        truth_values.save(truth, is_hidden=True)
        files.save_manifest(truth.manifest)

    def sent() -> str:
        return files.save_predictions(ContentFile(data), now=NOW).digest

    def scored() -> float:
        with files.opened_predictions(digest) as file:
            predictions = evaluator.read_predictions(file.read(), manifest=truth.manifest)
        files.save_aligned(predictions)
        files.store().delete(files.predictions_name(digest))
        mid = evaluator.evaluate(predictions, truth_values.load(truth.digest)).scores["overall"].mid
        assert mid is not None
        return mid

    def read() -> tuple[bytes, str]:
        with files.store().open(files.manifest_name(truth.manifest.digest), "rb") as file:
            manifest: bytes = file.read()
        return manifest, sent()

    as_account("tsttc", imported)
    digest = as_account("tsttc-web", sent)
    assert as_account("tsttc", scored) > 0
    # The worker removed the file; the web process writes it into the same folder again.
    assert as_account("tsttc-web", read) == (truth.manifest.to_csv(), digest)
    modes = {path.stat().st_mode & 0o7777 for path in (host.root / "var/lib/tsttc/files").rglob("*")}
    assert modes == {0o640, 0o2770}


@pytest.mark.slow
def test_the_web_account_opens_nothing_that_is_the_workers(host: Host) -> None:
    as_account("tsttc", lambda: truth_values.save(host.truth, is_hidden=True))
    begun, ended, number = FORK.Event(), FORK.Event(), FORK.Value("i")

    def work() -> None:
        number.value = os.getpid()
        begun.set()
        ended.wait()

    def attack(path: Path) -> str:
        try:
            return str([*path.iterdir()] if path.is_dir() else path.read_bytes()[:20])
        except PermissionError:
            return ""

    worker = FORK.Process(target=as_account, args=("tsttc", work))
    worker.start()
    begun.wait()
    try:
        of_worker = Path(f"/proc/{number.value}")
        paths = [host.private, truth_values.values_path(host.truth.digest), seeds.path()]
        paths += [of_worker / "environ", of_worker / "root", of_worker / "mem"]
        paths += [of_worker / "root" / str(seeds.path()).lstrip("/")]
        contents = [as_account("tsttc-web", partial(attack, path)) for path in paths]
    finally:
        ended.set()
        worker.join()
    assert contents == [""] * 7
