"""A reader that obeys its file: what it reaches, and what of its answer the worker believes."""

import ctypes
import json
import os
import random
import resource
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import structlog
from pytest_django import Settings

from evaluator import Manifest, Predictions, Rejected, read_manifest, read_truth, system_calls
from evaluator.predictions.loading import sha256_digest
from evaluator.truth import annotation_folders
from leaderboard.models import Edition, Evaluation, User
from leaderboard.queue import worker
from leaderboard.sandbox import child
from leaderboard.sandbox.child import ChildDied
from leaderboard.storage import files
from tests import builders
from tests.leaderboard.sandbox.hostile_reader import (
    ANNOTATIONS,
    MARK,
    WITHOUT_A_FILTER,
    attempts,
    obeying_its_file,
    says,
    write_site,
)

Read = Callable[[bytes], Predictions]
needs_a_filter = pytest.mark.skipif(
    system_calls.why_unavailable() is not None,
    reason=f"this system filters no system calls: {system_calls.why_unavailable()}",
)


@pytest.fixture
def manifest(tmp_path: Path) -> Manifest:
    return read_truth(builders.truth_csv(tmp_path / "truth.csv")).manifest


@pytest.fixture
def read(tmp_path: Path, manifest: Manifest) -> Read:
    manifest.save(tmp_path / "manifest.npz")

    def read_bytes(data: bytes) -> Predictions:
        with tempfile.TemporaryFile() as source:
            source.write(data)
            source.seek(0)
            return child.read_predictions(
                source,
                digest=sha256_digest(data),
                manifest=manifest,
                manifest_path=tmp_path / "manifest.npz",
                heartbeat=lambda: True,
                heartbeat_s=5.0,
            )

    return read_bytes


@pytest.fixture
def targets(tmp_path: Path) -> dict[str, str | int]:
    """Targets of the attempts: a truth, a secret, a file of the store."""
    private = tmp_path / "private"
    private.mkdir()
    for name in ("labels", "secret", "stored"):
        (private / name).write_text("hidden")
    named: dict[str, str | int] = {path.name: str(path) for path in private.iterdir()}
    return named | {"new": str(private / "new"), "directory": str(private)}


def table_of(read: Read, targets: dict[str, str | int]) -> dict[str, str]:
    """The outcome of each attempt of a reader that was taken over."""
    secret = ctypes.create_string_buffer(b"in memory")
    with socket.create_server(("127.0.0.1", 0)) as database:
        numbers = {"port": database.getsockname()[1], "address": ctypes.addressof(secret)}
        data = attempts(worker=os.getpid(), targets=targets | numbers)
        with pytest.raises(Rejected) as refusal:
            read(data)
    return {problem.where: problem.message for problem in refusal.value.problems}


@needs_a_filter
def test_reader_that_is_taken_over_reaches_nothing(
    read: Read, targets: dict[str, str | int], settings: Settings, tmp_path: Path
) -> None:
    with obeying_its_file(tmp_path, settings):
        table = table_of(read, targets)
    assert len(table) == 27
    assert table.pop("take more memory") == "ENOMEM"
    assert set(table.values()) == {"EPERM"}, table
    assert Path(str(targets["stored"])).exists()


def test_without_a_filter_it_still_opens_nothing(
    read: Read, targets: dict[str, str | int], settings: Settings, tmp_path: Path
) -> None:
    with obeying_its_file(tmp_path, settings, more=WITHOUT_A_FILTER):
        table = table_of(read, targets)
    opening = list(table)[: list(table).index("take more memory")]
    assert len(opening) == 14
    assert "reached" not in {table[name] for name in opening}, table
    assert table["take more memory"] == "ENOMEM"
    # What is left, and why there is a filter.
    assert (table["signal the worker"], table["unlink a stored file"]) == ("reached", "reached")


def test_worker_says_once_that_there_is_no_filter(
    read: Read, settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = os.uname()
    child._say_what_is_missing.cache_clear()
    monkeypatch.setattr(os, "uname", lambda: os.uname_result([*known[:4], "riscv64"]))
    with structlog.testing.capture_logs() as logged:
        for _ in range(2):
            with pytest.raises(Rejected):
                read(b"no file")
    child._say_what_is_missing.cache_clear()
    [line] = logged
    assert line["event"] == "readers_without_a_filter_of_system_calls"
    assert "riscv64" in line["reason"]


# --- a child that lies ------------------------------------------------------------------------------------


def good(**changes: object) -> bytes:
    """The first line of a good file's answer."""
    usual = {"verdict": "good", "digest": "DIGEST", "unit": "ttc", "keys": "anno_id", "enveloped": False}
    return json.dumps(usual | changes).encode() + b"\n"


def rejected(n_problems: object = 1, problems: object = None, **changes: object) -> bytes:
    problem = {"code": "not-json", "message": "No.", "where": ""} | changes
    listed = [problem] if problems is None else problems
    return json.dumps({"verdict": "rejected", "n_problems": n_problems, "problems": listed}).encode() + b"\n"


# The digest of a file cannot stand in the file: the reader takes it of the bytes, as the honest one does.
TRUTHFUL = (
    MARK
    + b"""
digest = loading.sha256_digest(data)
line = json.dumps({"verdict": "good", "digest": digest, "unit": "ttc", "keys": "anno_id", "enveloped": False})
values = [5.0] * manifest.n_sequences
CHANGE
answer = line.encode() + b"\\n" + struct.pack(f"<{len(values)}d", *values)
os.write(1, answer)
os._exit(0)
"""
)


def changed(change: str) -> bytes:
    return TRUTHFUL.replace(b"CHANGE", change.encode())


@pytest.mark.slow
@pytest.mark.parametrize("is_forked", [True, False])
def test_an_answer_as_an_honest_reader_gives_it_is_taken(
    read: Read, settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_forked: bool
) -> None:
    """Else the refusals below would prove nothing."""
    monkeypatch.setattr(child.fork_server, "AVAILABLE", is_forked)
    with obeying_its_file(tmp_path, settings):
        data = changed("values[1] = float('-inf')")
        predictions = read(data)
    assert predictions.digest == sha256_digest(data)
    assert predictions.ttc_s[:3].tolist() == [5.0, -np.inf, 5.0]


LIES = {
    "the digest of another team's file": (
        changed("line = line.replace(digest, 'sha256:' + '0' * 64)"),
        "another digest than sha256:",
    ),
    "no digest": (changed("line = line.replace('digest', 'digits')"), "another digest"),
    "NaN": (changed("values[3] = float('nan')"), "a value that no file may have"),
    "zero": (changed("values[3] = -0.0"), "a value that no file may have"),
    "a value too few": (changed("del values[3]"), "bytes where 120 values belong"),
    "a value too many": (changed("values.append(1)"), "bytes where 120 values belong"),
    "half a value": (changed("values.pop(); line += '\\n1234'"), "bytes where 120 values belong"),
    "an unknown unit": (changed("line = line.replace('ttc', 'weeks')"), "another form"),
    "a unit that is a list": (changed("line = line.replace('\"ttc\"', '[]')"), "another form"),
    "unknown keys": (changed("line = line.replace('anno_id', 'names')"), "another form"),
    "a verdict of its own": (says(good(verdict="brilliant")), "another form"),
    "nothing": (says(b""), "no answer"),
    "a list": (says(b"[]\n"), "no answer"),
    "nested lists": (says(b"[" * 100_000), "no answer"),
    "a number of 900,000 digits": (says(b"1" * 900_000), "no answer"),
    "no text": (says(b"\xff\xfe\n"), "no answer"),
    "no problems": (says(rejected(0, [])), "a rejection of another form"),
    "problems without end": (
        says(rejected(2000, [{"code": "nan", "message": "", "where": ""}] * 2000)),
        "1 to 1000",
    ),
    "a message of 100 kB": (says(rejected(message="x" * 100_000)), "at most 60,000 characters"),
    "a place of 100 kB": (says(rejected(where="x" * 100_000)), "at most 10,000 characters"),
    "a code of its own": (says(rejected(code="hacked")), "none of ours"),
    "a code that is a list": (says(rejected(code=[])), "no text"),
    "a further field": (says(rejected(secret="x")), "other fields"),
    "problems that are none": (says(rejected(2, ["x", 3])), "other fields"),
    "a count of words": (says(rejected("many")), "no number"),
    "a count beyond the database": (says(rejected(10**12)), "no number"),
}


@pytest.mark.slow
@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_refused_in_words(read: Read, settings: Settings, tmp_path: Path, lie: str) -> None:
    data, words = LIES[lie]
    with obeying_its_file(tmp_path, settings), pytest.raises(ChildDied, match=words):
        read(data)


@pytest.mark.slow
@pytest.mark.parametrize("descriptor", [1, 2])
def test_a_reader_that_writes_without_end_costs_the_worker_no_memory(
    read: Read, settings: Settings, tmp_path: Path, descriptor: int
) -> None:
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    endless = MARK + b"while True: os.write(%d, bytes(1 << 20))" % descriptor
    with (
        obeying_its_file(tmp_path, settings),
        pytest.raises(ChildDied, match=r"an answer of more than 1,000,960 bytes"),
    ):
        read(endless)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 30_000


@pytest.mark.slow
def test_values_of_another_file_are_not_replaced(
    edition: Edition, owner: User, settings: Settings, tmp_path: Path
) -> None:
    """By a reader that names the other file's digest, which is public."""
    theirs = builders.submit(owner, builders.predictions(edition), method="Theirs")
    builders.score_all()
    kept = files.load_aligned(theirs.sent_file, n_sequences=builders.N_SEQUENCES)
    assert kept is not None
    lie = f"line = line.replace(digest, {theirs.digest!r})"
    hostile = builders.submit(owner, changed(lie), method="Hostile")
    with obeying_its_file(tmp_path, settings):
        assert worker.run_next(rng=random.Random(0))
    assert "another digest" in Evaluation.objects.get(submission=hostile).last_error
    after = files.load_aligned(theirs.sent_file, n_sequences=builders.N_SEQUENCES)
    assert after is not None
    assert after.tolist() == kept.tolist()


# --- the reader of annotation files -----------------------------------------------------------------------


@pytest.fixture
def read_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], Manifest]:
    """Read a folder with this one file, which its reader executes."""
    site, folder = tmp_path / "site", tmp_path / "folder"
    site.mkdir()
    folder.mkdir()
    write_site(site, more=ANNOTATIONS)
    monkeypatch.syspath_prepend(site)

    def read_one(data: bytes) -> Manifest:
        (folder / "a.pkl").write_bytes(data)
        return read_manifest(folder)

    return read_one


@pytest.mark.slow
@needs_a_filter
def test_reader_of_annotations_that_is_taken_over_reaches_nothing(
    read_folder: Callable[[bytes], Manifest], targets: dict[str, str | int]
) -> None:
    numbers = {"port": 5432, "address": 4096}
    with pytest.raises(Rejected) as refusal:
        read_folder(attempts(worker=os.getpid(), targets=targets | numbers))
    table = {problem.where: problem.message for problem in refusal.value.problems}
    assert len(table) == 27
    # Its own limits it may lower, file by file; not raise, but for root.
    assert table.pop("raise its own limits") in {"EPERM", "reached"}
    assert table.pop("take more memory") == "ENOMEM"
    assert set(table.values()) == {"EPERM"}, table


@pytest.mark.slow
@pytest.mark.parametrize(
    "answer",
    [
        b"[]\n",
        b"{}\n",
        b"[" * 100_000 + b"\n",
        b'{"problems": [], "n_problems": 0}\n',
        b'{"table": {"anno_id": ["x"]}, "n_sequences": [1], "boxes": [], "frames": []}\n',
        b'{"table": {"anno_id": [1], "ttc_s": [1.0, 2.0]}, "n_sequences": [1], "boxes": [], "frames": []}\n',
        b'{"table": {"anno_id": [1]}, "n_sequences": [2], "boxes": [], "frames": []}\n',
        b'{"table": {"secret": [1]}, "n_sequences": [1], "boxes": [], "frames": []}\n',
    ],
)
def test_a_lie_about_annotations_is_refused_in_words(
    read_folder: Callable[[bytes], Manifest], answer: bytes
) -> None:
    with pytest.raises(Rejected, match="gave an answer of another form; expected annotations of the toolkit"):
        read_folder(says(answer))


@pytest.mark.slow
def test_reader_that_complains_without_end_is_ended(
    read_folder: Callable[[bytes], Manifest], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(annotation_folders, "_EXIT_TIMEOUT_S", 0.1)
    with pytest.raises(Rejected, match="Reading the file"):
        read_folder(MARK + b"os.close(1)\nwhile True: os.write(2, bytes(1 << 16))")
