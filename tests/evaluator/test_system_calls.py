"""`evaluator.system_calls`: what the filter lets through, on both architectures and in this kernel."""

import errno
import os
import signal
import struct
import subprocess
import sys

import pytest

from evaluator.system_calls import ALLOWED, program_for, why_unavailable

ALLOW, REFUSE, KILL = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x80000000
ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
I386 = 0x40000003

# The numbers on x86_64 and on aarch64; None where an architecture has only the newer call.
DANGEROUS = {
    "open": (2, None),
    "openat": (257, 56),
    "unlink": (87, None),
    "socket": (41, 198),
    "connect": (42, 203),
    "kill": (62, 129),
    "pidfd_open": (434, 434),
    "ptrace": (101, 117),
    "process_vm_readv": (310, 270),
    "clone": (56, 220),
    "fork": (57, None),
    "execve": (59, 221),
    "prctl": (157, 167),
    "seccomp": (317, 277),
    "prlimit64": (302, 261),
    "bpf": (321, 280),
    "memfd_create": (319, 279),
}

needs_a_filter = pytest.mark.skipif(
    why_unavailable() is not None, reason=f"this system filters no system calls: {why_unavailable()}"
)


def verdict(program: bytes, *, architecture: int, number: int) -> int:
    """Run the filter for this call as the kernel does."""
    call = struct.pack("=iIQ", number, architecture, 0)
    instructions = [struct.unpack_from("=HBBI", program, at) for at in range(0, len(program), 8)]
    word = position = 0
    while True:
        operation, if_equal, if_not, operand = instructions[position]
        position += 1
        if operation == 0x20:
            [word] = struct.unpack_from("=I", call, operand)
        elif operation == 0x15:
            position += if_equal if word == operand else if_not
        else:
            assert operation == 0x06
            return int(operand)


@pytest.mark.parametrize(("column", "machine"), list(enumerate(ARCHITECTURES)))
def test_filter_allows_what_it_names_and_refuses_every_other_number(column: int, machine: str) -> None:
    program = program_for(machine)
    architecture = ARCHITECTURES[machine]
    allowed = {numbers[column] for numbers in ALLOWED.values()}
    # 1 << 30 is the bit of the calls of x32.
    for number in (*range(600), *(number | 1 << 30 for number in range(600)), -1):
        expected = ALLOW if number in allowed else REFUSE
        assert verdict(program, architecture=architecture, number=number) == expected, number


@pytest.mark.parametrize(("column", "machine"), list(enumerate(ARCHITECTURES)))
def test_what_reaches_another_file_or_process_is_refused_by_name(column: int, machine: str) -> None:
    program = program_for(machine)
    for name, numbers in DANGEROUS.items():
        number = numbers[column]
        if number is not None:
            action = verdict(program, architecture=ARCHITECTURES[machine], number=number)
            assert action == REFUSE, name


@pytest.mark.parametrize("machine", ARCHITECTURES)
def test_calls_of_another_architecture_end_the_process(machine: str) -> None:
    program = program_for(machine)
    [other] = [number for name, number in ARCHITECTURES.items() if name != machine]
    for architecture in (I386, other):
        assert verdict(program, architecture=architecture, number=0) == KILL


def in_a_process(code: str) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)


@needs_a_filter
def test_kernel_obeys_the_filter_and_takes_none_of_it_back() -> None:
    code = """
import ctypes, os, signal
from evaluator.system_calls import allow_only_reading
allow_only_reading()
refused = []
libc = ctypes.CDLL(None, use_errno=True)
for act in (lambda: open("/etc/passwd"), lambda: os.listdir("/"), lambda: os.kill(os.getppid(), 0), os.fork,
             lambda: os.unlink("/nowhere"), lambda: os.stat("/"), lambda: os.dup(1), lambda: os.pipe()):
    try:
        act()
    except OSError as fault:
        refused.append(fault.errno)
ended = libc.prctl(22, 2, None), ctypes.get_errno()
os.write(1, repr((refused, ended)).encode())
"""
    done = in_a_process(code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.decode() == repr(([errno.EPERM] * 8, (-1, errno.EPERM)))


@needs_a_filter
@pytest.mark.skipif(os.uname().machine != "x86_64", reason="only x86_64 has a second set of numbers here")
def test_calls_by_the_door_of_the_32_bit_kernel_end_the_process() -> None:
    """`int 0x80` with the number of `getpid`: 20, which is another call on x86_64."""
    code = """
import ctypes, mmap
from evaluator.system_calls import allow_only_reading
page = mmap.mmap(-1, mmap.PAGESIZE, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
page.write(bytes.fromhex("b814000000cd80c3"))
call = ctypes.CFUNCTYPE(ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(page)))
allow_only_reading()
call()
print("went on")
"""
    done = in_a_process(code)
    assert b"went on" not in done.stdout
    # A kernel without the 32-bit door ends it as well, by another signal.
    assert done.returncode in {-signal.SIGSYS, -signal.SIGSEGV}


def test_unknown_machine_is_named_and_gets_no_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    known = os.uname()
    monkeypatch.setattr(os, "uname", lambda: os.uname_result([*known[:4], "riscv64"]))
    assert why_unavailable() == "the numbers of the system calls of riscv64 are not known here"
