"""Code execution in the process that reads files: the real process, which runs what a file says.

Nothing that is known makes the parser do that; this is what the process is limited for.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pytest_django import Settings

from leaderboard.sandbox import fork_server
from tests.chaos.processes import REPOSITORY

MARK = b"#run\n"

_SITE = """
import ctypes, errno, json, mmap, os, resource, signal, socket, struct, sys, time
sys.path.insert(0, {repository!r})
from evaluator import system_calls
from evaluator.predictions import loading
from evaluator.problems import Problem, Rejected
honest = loading.read_sent

def read_sent(data, *, manifest):
    if data.startswith({mark!r}):
        exec(data.decode(), dict(globals(), data=data, manifest=manifest))
    return honest(data, manifest=manifest)

loading.read_sent = read_sent
{more}
"""
ANNOTATIONS = f"""
import itertools
from evaluator.truth import annotations
honest_files = annotations.read_files

def read_files(files, **options):
    files = iter(files)
    name, data = first = next(files)
    if data.startswith({MARK!r}):
        exec(data.decode(), globals())
    return honest_files(itertools.chain([first], files), **options)

annotations.read_files = read_files
"""
WITHOUT_A_FILTER = "system_calls.why_unavailable = lambda: 'none here'"


def write_site(directory: Path, *, more: str = "") -> None:
    """Write the module that a Python with this directory on its path runs first."""
    site = _SITE.format(repository=str(REPOSITORY), mark=MARK, more=more)
    (directory / "sitecustomize.py").write_text(site)


@contextmanager
def obeying_its_file(directory: Path, settings: Settings, *, more: str = "") -> Iterator[None]:
    """Readers of this thread execute a file that begins with `MARK`, once they have given up their rights."""
    write_site(directory, more=more)
    settings.BASE_DIR = directory
    fork_server.server_of_this_thread(python_path=REPOSITORY).close()
    try:
        yield
    finally:
        fork_server.server_of_this_thread(python_path=REPOSITORY).close()


ATTEMPTS = """
libc = ctypes.CDLL(None, use_errno=True)

def called(name, *arguments):
    if getattr(libc, name)(*arguments) == -1:
        raise OSError(ctypes.get_errno(), name)

def room_for_one(path):
    # 2 is closed, and open again where there is room for as many as there were.
    os.close(2)
    return os.open(path, os.O_RDONLY)

def connect(family, address):
    with socket.socket(family, socket.SOCK_STREAM) as one:
        one.connect(address)

def look_into(pid, address):
    class Piece(ctypes.Structure):
        _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))
    into = ctypes.create_string_buffer(8)
    ours, theirs = Piece(ctypes.addressof(into), 8), Piece(address, 8)
    called("process_vm_readv", pid, ctypes.byref(ours), 1, ctypes.byref(theirs), 1, 0)

def fork():
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)

attempts = {
    "open the labels": lambda: os.open(targets["labels"], os.O_RDONLY),
    "open the secret": lambda: os.open(targets["secret"], os.O_RDONLY),
    "open the worker's environment": lambda: os.open(f"/proc/{worker}/environ", os.O_RDONLY),
    "open the worker's memory": lambda: os.open(f"/proc/{worker}/mem", os.O_RDONLY),
    "open its own maps": lambda: os.open("/proc/self/maps", os.O_RDONLY),
    "write a new file": lambda: os.open(targets["new"], os.O_WRONLY | os.O_CREAT),
    "list the labels": lambda: os.listdir(targets["directory"]),
    "list the processes": lambda: os.listdir("/proc"),
    "connect to the database": lambda: connect(socket.AF_INET, ("127.0.0.1", targets["port"])),
    "ask the network": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
    "duplicate a descriptor": lambda: os.dup(1),
    "make a pipe": os.pipe,
    "make a file in memory": lambda: os.memfd_create("x"),
    "close one and open": lambda: room_for_one(targets["labels"]),
    "take more memory": lambda: mmap.mmap(-1, 1 << 36),
    "read the size of a file": lambda: os.stat(targets["labels"]),
    "look into the worker": lambda: look_into(worker, targets["address"]),
    "trace the worker": lambda: called("ptrace", 0x4206, worker, 0, 0),
    "signal the worker": lambda: os.kill(worker, 0),
    "signal the server": lambda: os.kill(os.getppid(), 0),
    "limit the worker": lambda: resource.prlimit(worker, resource.RLIMIT_NPROC),
    "raise its own limits": lambda: called("setrlimit", 7, (ctypes.c_ulong * 2)(64, 64)),
    "let others read it": lambda: called("prctl", 4, 1, 0, 0, 0),
    "unlink a stored file": lambda: os.unlink(targets["stored"]),
    "make a directory": lambda: os.mkdir(targets["new"]),
    "start a process": fork,
    "execute a program": lambda: os.execv("/", ["a directory"]),
}
table = {}
for name, attempt in attempts.items():
    try:
        attempt()
    except OSError as fault:
        table[name] = errno.errorcode[fault.errno]
    else:
        table[name] = "reached"
names = list(table)
raise Rejected([Problem("not-json", table[name], name) for name in names])
"""


def attempts(*, worker: int, targets: dict[str, str | int]) -> bytes:
    """A file that tries all of it, and lists the outcome of each attempt in its rejection."""
    return MARK + f"worker = {worker}\ntargets = {targets!r}\n{ATTEMPTS}".encode()


def says(words: bytes) -> bytes:
    """A file whose reader writes these words as its answer, and ends as if all were well."""
    return (
        MARK
        + f"""
answer = {words!r}
while answer:
    answer = answer[os.write(1, answer):]
os._exit(0)
""".encode()
    )
