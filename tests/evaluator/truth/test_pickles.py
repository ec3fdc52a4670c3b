"""Pickles that ask for more than data get nothing."""

import builtins
import collections
import os
import pickle
import resource
import struct
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evaluator import Rejected
from evaluator.truth import pickles
from evaluator.truth.annotations import read_files
from evaluator.truth.pickles import Attributes, load_plain
from tests.evaluator.truth.hostile_pickles import name, text


class Calls:
    """An object whose pickle is a call."""

    def __init__(self, function: object, *arguments: object, state: object = None) -> None:
        self.call = (function, arguments) if state is None else (function, arguments, state)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.call


def load(data: bytes) -> object:
    return load_plain(data, where="a.pkl")


@pytest.fixture(autouse=True, scope="module")
def _memory() -> Iterator[None]:
    """Limit the memory: a few bytes may ask for all of it, and hypothesis finds them."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (512 << 20), hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def codes(data: bytes) -> set[str]:
    """The codes of the problems of an annotation file of this content."""
    with pytest.raises(Rejected) as rejected:
        read_files([("a.pkl", data)], with_ttc=True)
    assert {problem.where for problem in rejected.value.problems} == {"a.pkl"}
    return {problem.code for problem in rejected.value.problems}


PLAIN = [
    None, True, False, 0, -1, 255, 65_536, 2**40, -(2**70), 0.5,
    "text", "ünïcode \U0001f600", "x" * 70_000, b"bytes", b"\xff" * 300,
    [], [1, [2, [3]]], (), (1,), (1, 2), (1, 2, 3), (1, 2, 3, 4), {}, {"a": {"b": [1]}, 3: None, 0.5: 1},
    {1, 2},
]  # fmt: skip


@pytest.mark.parametrize("protocol", range(6))
def test_plain_data_reads_back_as_it_was(protocol: int) -> None:
    for value in [*PLAIN, PLAIN]:
        assert load(pickle.dumps(value, protocol=protocol)) == value


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6).reshape(2, 3)), np.array([True, False]),
        np.array([], dtype=np.float32), np.array(5.0), np.array([1, 2], dtype=">i4"), np.array([1j]),
    ],
)  # fmt: skip
def test_what_stands_beside_an_array_of_numbers_reads_back(array: np.ndarray, protocol: int) -> None:
    loaded = load(pickle.dumps({"box2d": array, "id": 7}, protocol=protocol))
    assert isinstance(loaded, dict)
    assert loaded["id"] == 7


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize(
    "scalar",
    [np.float64(5.25), np.float32(0.5), np.int64(7), np.bool_(True), np.uint8(200), np.array([7], ">i4")[0]],
)
def test_scalars_of_numpy_become_python_numbers(scalar: np.generic, protocol: int) -> None:
    loaded = load(pickle.dumps(scalar, protocol=protocol))
    assert loaded == scalar.item()
    assert type(loaded) is type(scalar.item())


@pytest.mark.parametrize("protocol", range(6))
def test_ordered_and_default_dicts_become_dicts(protocol: int) -> None:
    ordered = collections.OrderedDict(a=1, b=2)
    default = collections.defaultdict(list, {"a": [1]})
    assert load(pickle.dumps([ordered, default], protocol=protocol)) == [{"a": 1, "b": 2}, {"a": [1]}]


def test_names_of_python_two_are_understood() -> None:
    assert load(
        b"ccopy_reg\n_reconstructor\n(cfoo.bar\nAttrDict\nc__builtin__\ndict\n(dp0\nS'a'\nI1\nstR."
    ) == {"a": 1}
    assert type(load(b"(lp0\ncfoo\nEasyDict\n)\x81a.")[0]) is Attributes  # type: ignore[index]
    assert load(b"ccopy_reg\n__newobj__\n(cfoo\nEasyDict\ntR(dS'a'\nI1\nsb.") == {"a": 1}


# --- refused ---------------------------------------------------------------------------------------------

CALLS = {
    "os.system": Calls(os.system, "true"),
    "eval": Calls(builtins.eval, "1"),
    "getattr": Calls(getattr, "a", "upper"),
    "open": Calls(builtins.open, "/dev/null"),
    "subprocess": Calls(subprocess.Popen, ["true"]),
    "bytearray of a terabyte": Calls(bytearray, 10**12),
    "Path": Path("/etc/passwd"),
    "object array": np.array([{}], dtype=object),
    "records": np.zeros(1, dtype=[("a", "f8")]),
    "memory-mapped array": Calls(np.memmap, "/etc/passwd"),
}


@pytest.mark.parametrize("protocol", [0, 2, 4, 5])
@pytest.mark.parametrize("name", CALLS)
def test_calls_of_anything_else_are_refused(name: str, protocol: int) -> None:
    assert codes(pickle.dumps([CALLS[name]], protocol=protocol)) == {"forbidden-pickle"}


def proto2(body: bytes) -> bytes:
    return b"\x80\x02" + body + b"."


def proto4(body: bytes) -> bytes:
    return b"\x80\x04" + body + b"."


FORBIDDEN = {
    "dict-like name of the standard library": name("os", "SomeDict"),
    "dict-like name with a path": name("foo", "EasyDict.fromkeys.Dict"),
    "module hidden in a path": name("builtins", "dict.fromkeys"),
    "persistent id": b"K\x01Q",
    "persistent id as text": b"P1\n",
    "instance": b"(ios\nsystem\n",
    "array of objects": name("numpy", "dtype") + text("O8") + b"\x85R",
}


@pytest.mark.parametrize("case", FORBIDDEN)
def test_tricks_are_refused(case: str) -> None:
    assert codes(proto4(FORBIDDEN[case])) == {"forbidden-pickle"}


MEMBER = name("builtins", "dict")
STATES = {
    "attributes": b"}" + text("__new__") + MEMBER + b"s",
    "slots": b"N}" + text("__new__") + MEMBER + b"s\x86",
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("made", [b"", b")R", b")\x81", text("f8") + b"\x85R", text("a") + b"\x85\x81"])
@pytest.mark.parametrize("asked", [*pickles._ALLOWED, ("foo", "EasyDict")], ids=".".join)
def test_what_a_pickle_may_name_is_after_it_what_it_was(
    asked: tuple[str, str], made: bytes, state: str
) -> None:
    named = pickles._ALLOWED.get(asked, Attributes)
    before = dict(vars(named))
    assert codes(proto4(name(*asked) + made + STATES[state] + b"b")) <= {
        "bad-annotations",
        "forbidden-pickle",
    }
    assert dict(vars(named)) == before


BROKEN = {
    "state for a list": proto2(b"]}b"),
    "state for an instance of a type": proto4(name("builtins", "list") + b")R}b"),
    "out-of-band buffer": proto4(b"\x97"),
    "a number made by a call": pickle.dumps([Calls(int, "7")]),
    "nothing": b"",
    "no end": b"\x80\x04]",
    "bytes of an exabyte": proto4(b"\x8e" + struct.pack("<Q", 2**63)),
    "list as a key": proto2(b"}]K\x02s"),
    "call without a tuple": proto4(name("builtins", "dict") + b"K\x01R"),
    "unknown instruction": b"\x80\x04\xff.",
    "a number of 5,000 digits": b"I" + b"9" * 5000 + b"\n.",
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_pickles_are_no_more_than_that(case: str) -> None:
    assert codes(BROKEN[case]) <= {"bad-annotations", "forbidden-pickle"}


def test_state_of_an_attribute_dict_is_only_data() -> None:
    data = proto4(
        name("foo", "EasyDict") + b")\x81}(" + text("__class__") + text("x") + text("update") + b"Nub"
    )
    loaded = load(data)
    assert type(loaded) is Attributes
    assert loaded == {"__class__": "x", "update": None}
    assert callable(loaded.update)


def faults(data: bytes) -> set[str]:
    """The problem of a pickle, or nothing."""
    try:
        load(data)
    except Rejected as rejected:
        return {problem.code for problem in rejected.problems}
    return set()


@pytest.mark.slow
@settings(max_examples=300)
@given(data=st.binary(max_size=60))
@example(data=b"\x80\x04" + name("numpy", "dtype") + text("f8") + b"\x85R}b.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b")\x81Nb.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b")\x81K\x01b.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b"K\x01\x85R.")
@example(data=b"\x80\x04" + name("_codecs", "encode") + text("a") + b"]\x86R.")
def test_no_bytes_raise_anything_but_a_rejection(data: bytes) -> None:
    with suppress(MemoryError):
        assert faults(data) <= {"bad-annotations", "forbidden-pickle"}


@pytest.mark.slow
@settings(max_examples=300)
@given(
    at=st.integers(0, 400),
    n_removed=st.integers(0, 3),
    piece=st.binary(max_size=3),
    protocol=st.sampled_from([0, 2, 4]),
)
def test_mangled_annotations_raise_nothing_but_a_rejection(
    at: int, n_removed: int, piece: bytes, protocol: int
) -> None:
    content = [{0: [{"bag_stamp": "a", "box2d": np.zeros(4), "id": 7, "ts": 0, "ttc_imu": np.float64(5)}]}]
    data = pickle.dumps(content, protocol=protocol)
    data = data[:at] + piece + data[at + n_removed :]
    with suppress(MemoryError):
        assert faults(data) <= {"bad-annotations", "forbidden-pickle"}
