"""`leaderboard.sandbox.child`: what a file can do to the process that reads it, and to nothing else.

The child is the real one. Where a test needs it in the middle of its file, the file is a pipe that is still
open, and the heartbeat is the moment to look.
"""

import gzip
import itertools
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from pytest_django import Settings

from evaluator import Manifest, Rejected, read_predictions, read_truth, write_predictions
from evaluator.limits import READY
from evaluator.predictions.loading import Predictions, sha256_digest
from leaderboard.sandbox import child
from leaderboard.sandbox.child import ChildNotReady, LeaseLost
from tests import builders
from tests.chaos.processes import REPOSITORY
from tests.leaderboard.sandbox.child_processes import (
    children,
    fork_servers,
    ignores,
    is_reading,
    kernel_says,
    needs_root,
)

MAX_BEATS = 5000
FAULTY = b'{"0": "x", "nope": 1}'
Read = Callable[..., Predictions]


@pytest.fixture
def truth_path(tmp_path: Path) -> Path:
    return builders.truth_csv(tmp_path / "truth.csv")


@pytest.fixture
def manifest(truth_path: Path) -> Manifest:
    return read_truth(truth_path).manifest


@pytest.fixture
def read(tmp_path: Path, manifest: Manifest) -> Read:
    """Read a file in the sandbox."""
    kept = tmp_path / "kept.npz"
    manifest.save(kept)

    def read_source(
        source: IO[bytes],
        *,
        heartbeat: Callable[[], bool] = lambda: True,
        heartbeat_s: float = 5.0,
        manifest_path: Path = kept,
        digest: str = sha256_digest(FAULTY),
    ) -> Predictions:
        return child.read_predictions(
            source,
            digest=digest,
            manifest=manifest,
            manifest_path=manifest_path,
            heartbeat=heartbeat,
            heartbeat_s=heartbeat_s,
        )

    return read_source


@contextmanager
def opened(data: bytes) -> Iterator[IO[bytes]]:
    with tempfile.TemporaryFile() as file:
        file.write(data)
        file.seek(0)
        yield file


def read_slowly(read: Read, data: bytes, action: Callable[[int], object]) -> Predictions:
    """Do the action to the child in the middle of its file; only then the file comes to its end."""
    reading, writing = os.pipe()
    rest = [data]
    beats = itertools.count()

    def heartbeat() -> bool:
        assert next(beats) < MAX_BEATS, "the child does not begin to read"
        for pid in children():
            if rest and is_reading(pid):
                action(pid)
                os.write(writing, rest.pop())
                os.close(writing)
        return True

    with os.fdopen(reading, "rb") as source:
        return read(source, heartbeat=heartbeat, heartbeat_s=0.02)


@pytest.mark.slow
def test_good_file_comes_back_as_the_same_values(read: Read, manifest: Manifest, truth_path: Path) -> None:
    ttc_s = read_truth(truth_path).ttc_s * 1.25
    data = write_predictions(manifest=manifest, ttc_s=ttc_s)
    with opened(data) as source:
        assert np.array_equal(read(source, digest=sha256_digest(data)).ttc_s, ttc_s)


def test_a_good_file_is_read_without_late_imports(read: Read, manifest: Manifest) -> None:
    data = write_predictions(manifest=manifest, ttc_s=np.linspace(1, 9, manifest.n_sequences), keys="anno_id")
    for sent in (data, gzip.compress(data)):
        with opened(sent) as source:
            assert read(source, digest=sha256_digest(sent)).ttc_s[0] == 1


def test_faulty_file_is_rejected_with_the_words_of_the_evaluator(read: Read, manifest: Manifest) -> None:
    with pytest.raises(Rejected) as here:
        read_predictions(FAULTY, manifest=manifest)
    with opened(FAULTY) as source, pytest.raises(Rejected) as there:
        read(source)
    assert there.value.as_dict() == here.value.as_dict()


@pytest.mark.slow
@pytest.mark.parametrize(
    "data",
    [
        gzip.compress(b"", mtime=0) * 900_000,
        b"anno_id,ttc" + b"".join(b",c%d" % i for i in range(300_000)) + b"\n",
        gzip.compress(b"anno_id,ttc\n" + b"\n" * 60_000_000),
    ],
    ids=["members", "columns", "lines"],
)
def test_archives_and_tables_of_too_many_parts_are_refused_within_a_second_of_processor_time(
    read: Read, settings: Settings, data: bytes
) -> None:
    settings.CHILD_CPU_S = 1
    with opened(data) as source, pytest.raises(Rejected) as rejected:
        read(source)
    assert [problem.code for problem in rejected.value.problems] == ["too-many-members"]


def test_signals_that_stop_a_service_do_not_end_the_reading(read: Read) -> None:
    numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)

    def stop_the_service(pid: int) -> None:
        assert all(ignores(pid, number) for number in numbers)
        for number in numbers:
            os.kill(pid, number)

    with pytest.raises(Rejected):
        read_slowly(read, FAULTY, stop_the_service)


def test_hung_child_is_ended_when_the_lease_is(read: Read) -> None:
    hung: set[int] = set()
    beats = itertools.count()

    def hang_then_lose() -> bool:
        assert next(beats) < MAX_BEATS, "the child does not begin to read"
        for pid in filter(is_reading, children()):
            os.kill(pid, signal.SIGSTOP)
            hung.add(pid)
        return not hung

    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as source, os.fdopen(writing, "wb"), pytest.raises(LeaseLost):
        read(source, heartbeat=hang_then_lose, heartbeat_s=0.02)
    assert hung
    assert not children()


@pytest.mark.slow
def test_each_file_has_a_child_of_its_own_and_all_have_one_server(read: Read) -> None:
    seen: list[tuple[int, set[int]]] = []
    for _ in range(3):
        with pytest.raises(Rejected):
            read_slowly(read, FAULTY, lambda pid: seen.append((pid, fork_servers())))
    readers, servers = zip(*seen, strict=True)
    assert len(set(readers)) == 3
    assert len(servers[0]) == 1
    assert servers == (servers[0],) * 3


def test_server_that_has_ended_is_replaced_without_a_word(read: Read) -> None:
    with opened(FAULTY) as source, pytest.raises(Rejected):
        read(source)
    [before] = fork_servers()
    os.kill(before, signal.SIGKILL)
    with opened(FAULTY) as source, pytest.raises(Rejected):
        read(source)
    assert before not in fork_servers()


def test_server_that_ends_while_a_child_reads_takes_it_along_and_blames_no_file(read: Read) -> None:
    readers: list[int] = []

    def end_the_server(pid: int) -> None:
        readers.append(os.pidfd_open(pid))
        for server in fork_servers():
            os.kill(server, signal.SIGKILL)

    with pytest.raises(ChildNotReady, match="the process that starts reading processes ended"):
        read_slowly(read, FAULTY, end_the_server)
    ended, _, _ = select.select(readers, [], [], 60)
    os.close(readers[0])
    assert ended
    assert not fork_servers()


@needs_root
def test_server_has_no_descriptor_but_a_socket_and_no_credentials(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TSTTC_DATABASE_URL", "postgres://somebody:secret@db/tsttc")
    child.fork_server.server_of_this_thread(python_path=REPOSITORY).close()
    with opened(FAULTY) as source, tempfile.TemporaryFile() as left_open:
        os.set_inheritable(left_open.fileno(), True)
        with pytest.raises(Rejected):
            read(source)
    [server] = fork_servers()
    targets = {path.name: str(path.readlink()) for path in Path(f"/proc/{server}/fd").iterdir()}
    assert targets.pop("0").startswith("socket:")
    assert set(targets) == {"1", "2"}
    assert "secret" not in kernel_says(server, "environ")


def test_child_ends_with_a_parent_that_was_killed(tmp_path: Path, manifest: Manifest) -> None:
    """A worker that is killed leaves nothing behind that burns a processor."""
    manifest_path = tmp_path / "manifest.npz"
    manifest.save(manifest_path)
    command = [sys.executable, "-m", "evaluator.predictions.reader", str(manifest_path), "4000000000", "60"]
    parent = subprocess.Popen(
        # The shell, which the child's end of the pipe outlives, is the worker that is killed.
        ["sh", "-c", 'exec 3<&0; "$@" <&3 & echo $!; wait', "sh", *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert parent.stdin is not None
    assert parent.stdout is not None
    with parent.stdin, parent.stdout:
        child = os.pidfd_open(int(parent.stdout.readline()))
        assert parent.stdout.readline() == READY
        parent.kill()
        parent.wait()
        ended, _, _ = select.select([child], [], [], 60)
        os.close(child)
    assert ended
