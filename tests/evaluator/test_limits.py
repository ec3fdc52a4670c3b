"""`evaluator.limits`: what another process of the same user learns of one that keeps its memory private."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/proc and prctl are Linux's")

# Nothing is refused to root. A process that changes its user is private at first; this one is as any other.
BE_NOBODY = """
import ctypes, os, sys
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
    ctypes.CDLL(None).prctl(4, 1, 0, 0, 0)
"""
VICTIM = f"""
from evaluator.limits import keep_memory_private
{BE_NOBODY}
secret = ctypes.create_string_buffer(b"tsttc-secret-in-memory")
if sys.argv[1] == "private":
    keep_memory_private()
print(ctypes.addressof(secret), flush=True)
sys.stdin.read()
"""
ATTACKER = (
    f"{BE_NOBODY}"
    """
pid, address = map(int, sys.argv[1:])

def mem():
    with open(f"/proc/{pid}/mem", "rb") as memory:
        memory.seek(address)
        return memory.read(22)

def vm_readv():
    class Piece(ctypes.Structure):
        _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))
    into = ctypes.create_string_buffer(22)
    ours, theirs = Piece(ctypes.addressof(into), 22), Piece(address, 22)
    ctypes.CDLL(None).process_vm_readv(pid, ctypes.byref(ours), 1, ctypes.byref(theirs), 1, 0)
    return into.raw

for name, action in (("mem", mem), ("process_vm_readv", vm_readv),
                   ("environ", lambda: open(f"/proc/{pid}/environ", "rb").read()),
                   ("fd", lambda: str(os.listdir(f"/proc/{pid}/fd")).encode() and b"secret"),
                   ("root", lambda: str(os.listdir(f"/proc/{pid}/root")).encode() and b"secret")):
    try:
        reached = b"secret" in action()
    except OSError:
        reached = False
    if reached:
        print(name)
"""
)


def reached_by_another(how: str) -> set[str]:
    """Names of what a second process of the same user can read of a first one."""
    environment = {"PATH": os.defpath, "PYTHONPATH": os.environ.get("PYTHONPATH", ""), "SECRET": "secret"}
    with subprocess.Popen(
        [sys.executable, "-c", VICTIM, how],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=environment,
    ) as victim:
        assert victim.stdout is not None
        command = [sys.executable, "-c", ATTACKER, str(victim.pid), victim.stdout.readline().decode().strip()]
        return set(subprocess.run(command, capture_output=True, check=True, text=True).stdout.split())


def test_private_process_shows_another_of_its_user_nothing() -> None:
    # Where the kernel lets only parents trace (Yama), not all of it is to be seen before either.
    assert reached_by_another("open") & {"environ", "mem"}
    assert reached_by_another("private") == set()
