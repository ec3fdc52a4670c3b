"""The processes that this one has started, as the kernel sees them."""

import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest

needs_root = pytest.mark.skipif(
    os.geteuid() != 0, reason="the environment and the descriptors of a reader are shown to root alone"
)

READERS = {"evaluator.predictions.reader", "evaluator.truth.annotation_child"}
FORK_SERVER = "evaluator.predictions.reader_server"


def children() -> set[int]:
    """Ids of the readers of untrusted files that this process or its fork servers started and did not reap.

    Other tests of the same run have children as well, such as the driver of a browser.
    """
    pids = children_of("self")
    readers = {pid for pid in pids if READERS & set(kernel_says(pid, "cmdline").split("\0"))}
    return readers.union(*map(children_of, fork_servers()))


def fork_servers() -> set[int]:
    """The processes that fork readers for this one."""
    return {pid for pid in children_of("self") if FORK_SERVER in kernel_says(pid, "cmdline")}


def children_of(process: int | str) -> set[int]:
    """Ids of the processes that all threads of a process have started."""
    pids: set[int] = set()
    with suppress(FileNotFoundError):
        for task in Path(f"/proc/{process}/task").iterdir():
            # A thread that has ended meanwhile has no children.
            pids |= {int(pid) for pid in kernel_says(process, f"task/{task.name}/children").split()}
    return pids


def kernel_says(pid: int | str, name: str) -> str:
    """A file of the process's folder in /proc; empty once the process has ended."""
    with suppress(ProcessLookupError, FileNotFoundError):
        return Path(f"/proc/{pid}/{name}").read_text()
    return ""


def limits(pid: int) -> dict[str, list[str]]:
    """Soft and hard limit by name."""
    return {line[:26].strip(): line[26:].split()[:2] for line in kernel_says(pid, "limits").splitlines()}


def is_reading(pid: int) -> bool:
    """Say if the child has dropped its rights and reads its file."""
    return limits(pid).get("Max open files") == ["0", "0"]


def ignores(pid: int, number: signal.Signals) -> bool:
    """Say if the process ignores this signal."""
    masks = [line.partition(":")[2] for line in kernel_says(pid, "status").splitlines() if "SigIgn:" in line]
    return any(int(mask, 16) & 1 << (number - 1) for mask in masks)
