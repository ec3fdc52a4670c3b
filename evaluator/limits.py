"""The rights that a child process gives up before it reads untrusted bytes; then it writes `READY`."""

# `limit` leaves signals, deletion of the user's files and faults of the kernel; `forbid_calls` removes these.

import ctypes
import resource
import signal
import sys

from evaluator import system_calls

READY = b"ready\n"
EXIT_OUT_OF_MEMORY = 77
_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4


def obey_the_parent_alone() -> None:
    # A signal to the whole service must not end this child: the file would be blamed.
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def keep_memory_private() -> None:
    """Hide memory, environment and descriptors from debuggers and core dumps; forks inherit it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)


def limit(*, memory_bytes: int, cpu_s: int) -> None:
    """Give up what parsing does not need; irrevocable except for root."""
    keep_memory_private()
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    # What is open stays open. With room for three, whoever closed one could open another.
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))


def forbid_calls() -> None:
    """Allow only system calls that reading needs, if the kernel can; irrevocable. Raises `OSError`."""
    if system_calls.why_unavailable() is None:
        system_calls.allow_only_reading()
