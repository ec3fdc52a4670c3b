"""A seccomp filter for a process that reads untrusted bytes."""

# It allows computing, reading open files and writing the answer. Other calls get EPERM, so that libraries
# continue without them; calls of another architecture end the process.

import ctypes
import errno
import os
import struct
import sys
from collections.abc import Iterator
from typing import Final

ALLOWED: Final[dict[str, tuple[int, int]]] = {
    "read": (0, 63),
    "write": (1, 64),
    "close": (3, 57),
    "fstat": (5, 80),
    "lseek": (8, 62),
    "mmap": (9, 222),
    "mprotect": (10, 226),
    "munmap": (11, 215),
    "brk": (12, 214),
    "rt_sigaction": (13, 134),
    "rt_sigprocmask": (14, 135),
    "rt_sigreturn": (15, 139),
    "mremap": (25, 216),
    "madvise": (28, 233),
    "exit": (60, 93),
    "getrusage": (98, 165),
    "futex": (202, 98),
    "clock_gettime": (228, 113),
    "exit_group": (231, 94),
    "getrandom": (318, 278),
}
"""The numbers of each call on x86_64 and on aarch64."""

# By `os.uname().machine`: which of the numbers, and the kernel's name of the architecture (AUDIT_ARCH_…).
_ARCHITECTURES: Final = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}

_PR_SET_SECCOMP: Final = 22
_PR_SET_NO_NEW_PRIVS: Final = 38
_MODE_FILTER: Final = 2
_LOAD: Final = 0x20  # a word of `struct seccomp_data`: number at 0, architecture at 4
_JUMP_IF_EQUAL: Final = 0x15
_RETURN: Final = 0x06
_ALLOW: Final = 0x7FFF0000
_REFUSE: Final = 0x00050000 | errno.EPERM
_KILL: Final = 0x80000000


class _Program(ctypes.Structure):
    _fields_ = (("n_instructions", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


def why_unavailable() -> str | None:
    if sys.platform != "linux":
        return f"{sys.platform} has no seccomp"
    machine = os.uname().machine
    if machine not in _ARCHITECTURES:
        return f"the numbers of the system calls of {machine} are not known here"
    # A kernel that filters calls looks for the program, which is not there.
    fault = _prctl(_PR_SET_SECCOMP, _MODE_FILTER, None)
    return None if fault == errno.EFAULT else f"the kernel takes no filter: {os.strerror(fault)}"


def allow_only_reading() -> None:
    """Allow this thread only the calls of `ALLOWED`, irrevocably; raises `OSError` if the kernel refuses."""
    program = program_for(os.uname().machine)
    filter_ = _Program(len(program) // 8, program)
    fault = _prctl(_PR_SET_NO_NEW_PRIVS, 1) or _prctl(_PR_SET_SECCOMP, _MODE_FILTER, ctypes.byref(filter_))
    if fault:
        raise OSError(fault, os.strerror(fault))


def program_for(machine: str) -> bytes:
    """Build the filter, instructions of 8 bytes. Raises `KeyError` for unknown machines."""
    return b"".join(struct.pack("=HBBI", *one) for one in _instructions(machine))


def _instructions(machine: str) -> Iterator[tuple[int, int, int, int]]:
    column, architecture = _ARCHITECTURES[machine]
    yield _LOAD, 0, 0, 4
    yield _JUMP_IF_EQUAL, 1, 0, architecture
    yield _RETURN, 0, 0, _KILL
    yield _LOAD, 0, 0, 0
    for numbers in ALLOWED.values():
        yield _JUMP_IF_EQUAL, 0, 1, numbers[column]
        yield _RETURN, 0, 0, _ALLOW
    yield _RETURN, 0, 0, _REFUSE


def _prctl(option: int, argument: int, pointer: object = 0) -> int:
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    prctl.argtypes = (ctypes.c_int, ctypes.c_ulong, ctypes.c_void_p, ctypes.c_ulong, ctypes.c_ulong)
    return ctypes.get_errno() if prctl(option, argument, pointer, 0, 0) else 0
