"""A run that is ended from outside leaves no process behind, and the same command continues it.

An image that is a named pipe stops a process at a known step: it opens for writing when a process reads it.
"""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.evaluator.worlds import REPOSITORY, Tsttc
from tests.leaderboard.sandbox.child_processes import children_of, kernel_says
from tests.signals import default_signals
from tests.tsttc_baselines.made_folders import image_path, made_folder
from tsttc_baselines.journals import Journal

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes"),
]

N = 20
MOST_S = 180


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twenty sequences; one of them never ends."""
    (tmp_path / "in").mkdir()
    folder = made_folder(tmp_path / "in", n=N)
    pipe = image_path(folder, 12, 0)
    pipe.rename(folder / "aside")
    os.mkfifo(pipe)
    return folder


@contextmanager
def waiting_run(folder: Path) -> Iterator[tuple["subprocess.Popen[str]", int]]:
    """Start a run in its own process group that waits for the image; give it and the image's writing end."""
    out = folder.parent / "p.json"
    words = ["baseline", "run", "pixel-mse", str(folder), "--out", str(out), "--jobs", "2"]
    with default_signals():
        process = subprocess.Popen(
            [sys.executable, "-m", "evaluator", *words],
            cwd=REPOSITORY,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
    guard = subprocess.Popen(  # ends a test whose image is never opened
        [sys.executable, "-c", f"import time; time.sleep({MOST_S}); open({str(image_path(folder, 12, 0))!r})"]
    )
    end = os.open(image_path(folder, 12, 0), os.O_WRONLY)
    try:
        yield process, end
    finally:
        guard.kill()
        guard.wait()
        os.close(end)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def nobody_reads(end: int) -> bool:
    """Wait until no process has the image open."""
    poll = select.poll()
    poll.register(end, select.POLLERR)
    return bool(poll.poll(1000 * MOST_S))


def mend(folder: Path) -> None:
    """Put the image where the pipe is."""
    (folder / "aside").replace(image_path(folder, 12, 0))


def predictions_of(tsttc: Tsttc, folder: Path, name: str) -> dict[str, float]:
    out = folder.parent / name
    result = tsttc("baseline", "run", "pixel-mse", folder, "--out", out, "--jobs", 1)
    assert result.exit_code == 0, result.stderr
    predictions: dict[str, float] = json.loads(out.read_text())["predictions"]
    return predictions


@pytest.mark.slow
def test_a_killed_run_leaves_no_process_and_continues(folder: Path, tsttc: Tsttc) -> None:
    with waiting_run(folder) as (process, end):
        process.kill()
        assert nobody_reads(end)
    assert not (folder.parent / "p.json").exists()
    mend(folder)
    continued, whole = (predictions_of(tsttc, folder, name) for name in ("p.json", "whole.json"))
    assert continued == pytest.approx(whole, rel=1e-9)  # numpy adds in another order in several threads
    assert {path.name for path in folder.parent.iterdir()} == {"in", "p.json", "whole.json"}


@pytest.mark.slow
def test_ctrl_c_ends_a_run_at_once_and_in_words(folder: Path) -> None:
    with waiting_run(folder) as (process, end):
        os.killpg(process.pid, signal.SIGINT)
        assert nobody_reads(end)
        _, complaints = process.communicate(timeout=MOST_S)
        assert process.returncode == 130
    assert complaints.splitlines()[-1] == "Interrupted."
    assert "Traceback" not in complaints
    assert (folder.parent / "p.json.part").exists()


@pytest.mark.slow
def test_a_process_that_dies_is_reported_in_words(folder: Path) -> None:
    with waiting_run(folder) as (process, end):
        for child in children_of(process.pid):
            if "spawn_main" in kernel_says(child, "cmdline"):
                os.kill(child, signal.SIGKILL)
        assert nobody_reads(end)
        _, complaints = process.communicate(timeout=MOST_S)
        assert process.returncode == 1
    assert complaints.splitlines()[-1] == (
        "Error: A process of the run ended, probably because memory ran out; "
        "the same command with fewer --jobs continues the run."
    )


def test_two_runs_do_not_write_one_file(folder: Path, tsttc: Tsttc) -> None:
    mend(folder)
    out = folder.parent / "p.json"
    with Journal(folder.parent / "p.json.part", key="another"):
        result = tsttc("baseline", "run", "pixel-mse", folder, "--out", out, "--jobs", 1)
    assert result.exit_code == 2
    assert result.stderr == f"Error: Another run writes {out}; wait for it, or name another file.\n"
