"""Folders of annotation files are read by a child process, and a hostile file ends no more than that."""

import os
import resource
import signal
import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from evaluator import Rejected, read_manifest, read_truth
from evaluator.truth import annotation_folders
from evaluator.truth.annotation_folders import read_annotations
from tests.evaluator.toolkit_folders import camera, foreign_class, write_folder
from tests.evaluator.truth.hostile_pickles import CHEAP, HOSTILE
from tests.leaderboard.sandbox.child_processes import children, kernel_says, limits, needs_root

SIX = list(range(6))


def problem_of(folder: Path) -> tuple[str, str, str]:
    with pytest.raises(Rejected) as rejected:
        read_manifest(folder)
    [problem] = rejected.value.problems
    return problem.code, problem.where, problem.message


def cpu_s() -> float:
    """Processor time of the children that have ended, in seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_pickle_is_refused_in_words_within_the_limits(tmp_path: Path, case: str) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX})], "b.pkl": HOSTILE[case]()})
    before = cpu_s()
    try:
        assert read_manifest(tmp_path).n_sequences == 1
        assert case in CHEAP
    except Rejected as rejected:
        [problem] = rejected.problems
        assert (problem.code, problem.where) in {("bad-annotations", "b.pkl"), ("too-large", "b.pkl")}
    assert cpu_s() - before < 4
    assert not children()


def test_pickle_that_takes_all_memory_is_refused_without_limits_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(annotation_folders, "HAS_LIMITS", False)
    write_folder(tmp_path, {"a.pkl": HOSTILE["a text of an exabyte"]()})
    message = "Reading the files needs more memory than there is; expected annotations of the toolkit."
    assert problem_of(tmp_path) == ("too-large", tmp_path.name, message)


@pytest.mark.slow
@pytest.mark.parametrize("has_limits", [True, False])
def test_a_folder_reads_the_same_in_a_child_and_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_limits: bool
) -> None:
    with foreign_class("easydict.EasyDict") as make:
        for protocol in range(6):
            frames = camera({7: [*range(12)], 3: [*range(3, 20)]}, make, bag_stamp=f"bag{protocol}")
            write_folder(tmp_path, {f"{9 - protocol}.pkl": [frames]}, protocol=protocol)
    monkeypatch.setattr(annotation_folders, "HAS_LIMITS", has_limits)
    truth = read_truth(tmp_path)
    assert truth.manifest.recordings == tuple(f"bag{protocol}" for protocol in range(6))
    assert truth.manifest.bag_stamp[0] == "bag5"
    assert truth.ttc_s[:3].tolist() == [9.5, 9.2, 8.9]
    assert read_annotations(tmp_path, with_ttc=True).n_sequences == [4] * 6


Contents = Iterator[tuple[str, bytes]]


@pytest.fixture
def three(tmp_path: Path) -> Path:
    """A folder of three files."""
    return write_folder(tmp_path, {f"{name}.pkl": [camera({7: SIX}, bag_stamp=name)] for name in "abc"})


def at_the_second_file(monkeypatch: pytest.MonkeyPatch, action: Callable[[int], object]) -> None:
    """Do the action to the child between its first file and its second."""
    real = annotation_folders._contents

    def contents(folder: Path, files: Sequence[Path]) -> Contents:
        for number, item in enumerate(real(folder, files)):
            if number == 1:
                [pid] = children()
                action(pid)
            yield item

    monkeypatch.setattr(annotation_folders, "_contents", contents)


@pytest.mark.slow
def test_child_that_dies_is_a_problem_of_the_file_that_it_was_at(
    three: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_the_second_file(monkeypatch, lambda pid: os.kill(pid, signal.SIGKILL))
    code, where, message = problem_of(three)
    assert (code, where) == ("bad-annotations", "b.pkl")
    assert message == "Reading the file ended its process with signal 9; expected annotations of the toolkit."
    assert not children()


@pytest.mark.slow
def test_file_that_needs_too_much_memory_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(annotation_folders, "_BASE_BYTES", 300 << 20)
    monkeypatch.setattr(annotation_folders, "_BYTES_PER_BYTE", 0)
    n_bytes = 120_000_000
    write_folder(tmp_path, {"a.pkl": b"\x80\x04B" + struct.pack("<I", n_bytes)})
    os.truncate(tmp_path / "a.pkl", 7 + n_bytes)
    assert problem_of(tmp_path) == (
        "too-large",
        "a.pkl",
        "Reading the file needs more than 300 MiB; expected annotations of the toolkit.",
    )


@needs_root
def test_child_has_no_secrets_and_may_open_nothing(three: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSTTC_TOKEN", "tsttc_secret")
    observed: list[tuple[str, list[str]]] = []
    at_the_second_file(
        monkeypatch, lambda pid: observed.append((kernel_says(pid, "environ"), limits(pid)["Max open files"]))
    )
    assert read_manifest(three).n_sequences == 3
    [(environment, open_files)] = observed
    assert "OPENBLAS_NUM_THREADS" in environment
    assert "secret" not in environment
    assert open_files == ["0", "0"]
    assert not children()


@pytest.mark.slow
def test_child_that_does_not_start_blames_no_file(three: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(annotation_folders, "_BASE_BYTES", 1 << 70)
    monkeypatch.setattr(annotation_folders, "_BYTES_PER_BYTE", 0)
    code, where, message = problem_of(three)
    assert (code, where) == ("unreadable", three.name)
    assert message.startswith("The process that reads the files did not start: ")
