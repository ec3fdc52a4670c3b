"""What a child process that reads untrusted bytes gives up before it sees the first of them.

It writes `READY` when that is done: a child that ends before has seen nothing of what it was to read.
"""

import ctypes
import resource
import signal
import sys

READY = b"ready\n"
EXIT_OUT_OF_MEMORY = 77
_PR_SET_PDEATHSIG = 1


def obey_the_parent_alone() -> None:
    """End with the parent, however it ends, and only then.

    A signal that stops a whole service reaches this process too; were it to die of that, the file would be
    blamed. The parent finishes what it has in hand, and ends this process if it must.
    """
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def limit(*, memory_bytes: int, cpu_s: int) -> None:
    """Give up what parsing does not need. Irrevocable for this process."""
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    # Standard input, output and error are open already; nothing else ever will be.
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))


def allow_cpu(seconds: int) -> None:
    """From now on this process may compute for so long, within what `limit` has left it."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    soft = int(used.ru_utime + used.ru_stime) + 1 + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (min(soft, hard), hard))
