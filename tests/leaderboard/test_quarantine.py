"""`leaderboard.quarantine`: what a file can do to the process that reads it, and to nothing else.

The child is the real one. Where a test needs it alive at a certain moment, the heartbeat is that moment.
"""

import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from pytest_django import Settings

from evaluator import Manifest, Rejected, read_predictions, read_truth, write_predictions
from evaluator.predictions import Predictions
from evaluator.quarantine import READY
from leaderboard import quarantine
from leaderboard.quarantine import ChildDied, ChildNotReady, LeaseLost
from tests import builders


@pytest.fixture
def truth_path(tmp_path: Path) -> Path:
    return builders.truth_csv(tmp_path / "truth.csv")


@pytest.fixture
def manifest(truth_path: Path) -> Manifest:
    return read_truth(truth_path).manifest


@pytest.fixture
def read(tmp_path: Path, manifest: Manifest) -> Callable[..., Predictions]:
    """Read bytes in quarantine."""
    manifest_path = tmp_path / "manifest.npz"
    manifest.save(manifest_path)

    def read_bytes(
        data: bytes,
        *,
        heartbeat: Callable[[], bool] = lambda: True,
        heartbeat_s: float = 5.0,
        manifest_path: Path = manifest_path,
    ) -> Predictions:
        with opened(data) as source:
            return quarantine.read_predictions(
                source,
                manifest=manifest,
                manifest_path=manifest_path,
                heartbeat=heartbeat,
                heartbeat_s=heartbeat_s,
            )

    return read_bytes


@contextmanager
def opened(data: bytes) -> Iterator[IO[bytes]]:
    with tempfile.TemporaryFile() as file:
        file.write(data)
        file.seek(0)
        yield file


def children() -> set[int]:
    """Processes that this one has started and not yet buried."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        found |= {int(pid) for pid in (task / "children").read_text().split()}
    return found


def kernel_says(pid: int, name: str) -> str:
    """A file of the process's folder in /proc; empty once the process has ended."""
    with suppress(ProcessLookupError, FileNotFoundError):
        return Path(f"/proc/{pid}/{name}").read_text()
    return ""


def many_duplicates(n: int) -> bytes:
    """A file whose faults take long, and much memory, to word."""
    return b"{" + b",".join([b'"0":1.5'] * n) + b"}"


def test_good_file_comes_back_as_the_same_values(
    read: Callable[..., Predictions], manifest: Manifest, truth_path: Path
) -> None:
    ttc_s = read_truth(truth_path).ttc_s * 1.25
    data = write_predictions(manifest=manifest, ttc_s=ttc_s)
    assert np.array_equal(read(data).ttc_s, ttc_s)


def test_faulty_file_is_rejected_with_the_words_of_the_evaluator(
    read: Callable[..., Predictions], manifest: Manifest
) -> None:
    data = b'{"0": "x", "nope": 1}'
    with pytest.raises(Rejected) as here:
        read_predictions(data, manifest=manifest)
    with pytest.raises(Rejected) as there:
        read(data)
    assert there.value.as_dict() == here.value.as_dict()


def test_file_that_needs_too_much_memory_ends_the_child_alone(
    read: Callable[..., Predictions], settings: Settings
) -> None:
    settings.CHILD_MEMORY_BYTES = 400_000_000
    with pytest.raises(ChildDied, match=r"needed more than 400 MB of memory|ended with signal"):
        read(many_duplicates(3_000_000))
    assert not children()


def test_file_that_takes_too_long_ends_the_child_alone(
    read: Callable[..., Predictions], settings: Settings
) -> None:
    settings.CHILD_CPU_S = 1
    with pytest.raises(ChildDied, match=f"ended with signal {int(signal.SIGXCPU)}"):
        read(many_duplicates(2_000_000))
    assert not children()


def test_child_that_is_killed_is_reported(read: Callable[..., Predictions]) -> None:
    def kill() -> bool:
        for pid in children():
            os.kill(pid, signal.SIGKILL)
        return True

    with pytest.raises((ChildDied, ChildNotReady), match="ended with signal 9"):
        read(many_duplicates(1_000_000), heartbeat=kill, heartbeat_s=0.05)


def test_signals_that_stop_a_service_do_not_end_the_reading_of_a_file(
    read: Callable[..., Predictions],
) -> None:
    sent: list[int] = []

    def stop_the_service() -> bool:
        for pid in children():
            # A signal may come before the child has made itself deaf; that moment is not the one in question.
            if ignores(pid, signal.SIGQUIT):
                for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
                    os.kill(pid, number)
                    sent.append(number)
        return True

    with pytest.raises(Rejected):
        read(many_duplicates(1_000_000), heartbeat=stop_the_service, heartbeat_s=0.05)
    assert sent


def ignores(pid: int, number: signal.Signals) -> bool:
    """Whether the process has said that it will not hear this signal."""
    lines = kernel_says(pid, "status").splitlines()
    masks = [line.partition(":")[2] for line in lines if line.startswith("SigIgn:")]
    return any(int(mask, 16) & 1 << (number - 1) for mask in masks)


def test_hung_child_is_ended_when_the_lease_is(read: Callable[..., Predictions]) -> None:
    beats = 0

    def hang_then_lose() -> bool:
        nonlocal beats
        beats += 1
        for pid in children():
            os.kill(pid, signal.SIGSTOP)
        return beats < 3

    with pytest.raises(LeaseLost):
        read(many_duplicates(1_000_000), heartbeat=hang_then_lose, heartbeat_s=0.05)
    assert not children()


def test_child_that_cannot_begin_does_not_blame_the_file(
    read: Callable[..., Predictions], manifest: Manifest, truth_path: Path, tmp_path: Path
) -> None:
    data = write_predictions(manifest=manifest, ttc_s=read_truth(truth_path).ttc_s)
    with pytest.raises(ChildNotReady, match="did not start: ended with exit code 1"):
        read(data, manifest_path=tmp_path / "absent.npz")


def test_child_has_no_credentials_in_its_environment(
    read: Callable[..., Predictions], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TSTTC_DATABASE_URL", "postgres://somebody:secret@db/tsttc")
    seen: list[str] = []

    def look() -> bool:
        seen.extend(kernel_says(pid, "environ") for pid in children())
        return True

    with pytest.raises(Rejected):
        read(many_duplicates(1_000_000), heartbeat=look, heartbeat_s=0.05)
    assert any("OPENBLAS_NUM_THREADS" in environment for environment in seen)
    assert not any("secret" in environment for environment in seen)


def test_child_may_open_nothing_and_write_no_file(read: Callable[..., Predictions]) -> None:
    limits: list[str] = []

    def look() -> bool:
        limits.extend(kernel_says(pid, "limits") for pid in children())
        return True

    with pytest.raises(Rejected):
        read(many_duplicates(1_000_000), heartbeat=look, heartbeat_s=0.05)
    while_reading = next(text for text in reversed(limits) if text)
    rows = {line[:26].strip(): line[26:].split()[:2] for line in while_reading.splitlines()}
    assert rows["Max open files"] == ["3", "3"]
    assert rows["Max file size"] == ["0", "0"]
    assert rows["Max processes"] == ["0", "0"]
    assert rows["Max core file size"] == ["0", "0"]


def test_child_ends_with_a_parent_that_was_killed(tmp_path: Path, manifest: Manifest) -> None:
    """A worker that is killed leaves nothing behind that burns a processor."""
    manifest_path = tmp_path / "manifest.npz"
    manifest.save(manifest_path)
    command = [sys.executable, "-m", "evaluator.quarantine", str(manifest_path), "4000000000", "60"]
    with opened(many_duplicates(3_000_000)) as source:
        parent = subprocess.Popen(
            ["sh", "-c", '"$@" <&0 & echo $!; wait', "sh", *command],
            stdin=source,
            stdout=subprocess.PIPE,
        )
        assert parent.stdout is not None
        with parent.stdout:
            child = os.pidfd_open(int(parent.stdout.readline()))
            assert parent.stdout.readline() == READY
            parent.kill()
            parent.wait()
            ended, _, _ = select.select([child], [], [], 10)
            os.close(child)
    assert ended
