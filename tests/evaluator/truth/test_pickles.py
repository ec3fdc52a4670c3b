"""Pickles that ask for more than data get nothing."""

import builtins
import collections
import os
import pickle
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evaluator import Rejected
from evaluator.pickles import load_plain
from evaluator.plain_values import Attributes


class Calls:
    """An object whose pickle is a call."""

    def __init__(self, function: object, *arguments: object, state: object = None) -> None:
        self.call = (function, arguments) if state is None else (function, arguments, state)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.call


def load(data: bytes) -> object:
    return load_plain(data, where="a.pkl")


def codes(data: bytes) -> set[str]:
    with pytest.raises(Rejected) as rejected:
        load(data)
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
def test_values_that_were_one_object_stay_one_object(protocol: int) -> None:
    shared = [1, 2]
    found = load(pickle.dumps([shared, shared], protocol=protocol))
    assert isinstance(found, list)
    assert found[0] is found[1]


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6).reshape(2, 3)), np.array([True, False]),
        np.array([], dtype=np.float32), np.array(5.0), np.array([1, 2], dtype=">i4"), np.array([1j]),
    ],
)  # fmt: skip
def test_arrays_of_numbers_read_back(array: np.ndarray, protocol: int) -> None:
    found = load(pickle.dumps({"box2d": array}, protocol=protocol))
    assert isinstance(found, dict)
    np.testing.assert_array_equal(found["box2d"], array)
    assert found["box2d"].dtype.newbyteorder("=") == array.dtype.newbyteorder("=")


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize(
    "scalar", [np.float64(5.25), np.float32(0.5), np.int64(7), np.bool_(True), np.uint8(200)]
)
def test_scalars_of_numpy_become_python_numbers(scalar: np.generic, protocol: int) -> None:
    found = load(pickle.dumps(scalar, protocol=protocol))
    assert found == scalar.item()
    assert type(found) is type(scalar.item())


def test_a_file_cannot_change_the_dtypes_of_the_program() -> None:
    data = pickle.dumps(np.array([1.0], dtype=">f8"), protocol=2)
    load(data)
    assert np.dtype("f8").byteorder in {"=", "|"}


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


# --- refused ---------------------------------------------------------------------------------------------

CALLS = {
    "os.system": Calls(os.system, "true"),
    "eval": Calls(builtins.eval, "1"),
    "exec": Calls(builtins.exec, "1"),
    "getattr": Calls(getattr, "a", "upper"),
    "import": Calls(builtins.__import__, "os"),
    "open": Calls(builtins.open, "/dev/null"),
    "subprocess": Calls(subprocess.Popen, ["true"]),
    "bytearray of a terabyte": Calls(bytearray, 10**12),
    "range": Calls(range, 10**12),
    "str": Calls(str, [1]),
    "type": Calls(type, "A", (), {}),
    "object": Calls(object),
    "int": Calls(int, "7"),
    "Path": Path("/etc/passwd"),
    "named tuple": Path().stat(),
    "complex": 1j,
    "class": Rejected,
    "slice": slice(1),
    "object array": np.array([{}], dtype=object),
    "records": np.zeros(1, dtype=[("a", "f8")]),
    "text array": np.array(["a"]),
    "dates": np.array(["2020-01-01"], dtype="datetime64[D]"),
    "memory-mapped array": Calls(np.memmap, "/etc/passwd"),
    "numpy.load": Calls(np.load, "/etc/passwd"),
}


@pytest.mark.parametrize("protocol", [0, 2, 4, 5])
@pytest.mark.parametrize("name", CALLS)
def test_calls_of_anything_else_are_refused(name: str, protocol: int) -> None:
    assert codes(pickle.dumps([CALLS[name]], protocol=protocol)) == {"forbidden-pickle"}


def test_a_refusal_names_what_was_asked_for() -> None:
    with pytest.raises(Rejected) as rejected:
        load(b"cos\nsystem\n(S'touch /tmp/x'\ntR.")
    assert rejected.value.problems[0].message == (
        'The pickle asks for "os.system"; expected plain containers, numbers and attribute-dicts.'
    )


def proto2(body: bytes) -> bytes:
    return b"\x80\x02" + body + b"."


def proto4(body: bytes) -> bytes:
    return b"\x80\x04" + body + b"."


def text(value: str) -> bytes:
    return b"\x8c" + bytes([len(value)]) + value.encode()


def name(module: str, attribute: str) -> bytes:
    return text(module) + text(attribute) + b"\x93"


FORBIDDEN = {
    "dict-like name of the standard library": name("os", "SomeDict"),
    "dict-like name with a path": name("foo", "EasyDict.fromkeys.Dict"),
    "module hidden in a path": name("builtins", "dict.fromkeys"),
    "state for a list": b"]}b",
    "state for a dict": b"}}b",
    "state for an instance of a type": name("builtins", "list") + b")R}b",
    "list by __new__": name("builtins", "list") + b")\x81",
    "dtype by __new__": name("numpy", "dtype") + b"X\x02\x00\x00\x00f8\x85\x81",
    "persistent id": b"K\x01Q",
    "extension": b"\x82\x01",
    "out-of-band buffer": b"\x97",
    "instance": b"(ios\nsystem\n",
    "object": b"(" + name("foo", "EasyDict") + b"o",
    "NEWOBJ_EX": name("foo", "EasyDict") + b")}\x92",
    "marker type called": name("builtins", "object") + b")R",
    "array of objects": name("numpy", "dtype") + text("O8") + b"\x85R",
}


@pytest.mark.parametrize("case", FORBIDDEN)
def test_tricks_are_refused(case: str) -> None:
    assert codes(proto4(FORBIDDEN[case])) == {"forbidden-pickle"}


def array_state(shape: bytes, kind: bytes = b"f8", raw: bytes = b"") -> bytes:
    """`_reconstruct` and a state of the given shape."""
    dtype = name("numpy", "dtype") + b"X" + struct.pack("<I", len(kind)) + kind + b"\x85R"
    array = name("numpy.core.multiarray", "_reconstruct") + name("numpy", "ndarray") + b"K\x00\x85C\x01b\x87R"
    return array + b"(K\x01" + shape + dtype + b"\x89C" + bytes([len(raw)]) + raw + b"tb"


BROKEN = {
    "nothing": b"",
    "no end": b"\x80\x04]",
    "text of an exabyte": proto4(b"\x8d" + struct.pack("<Q", 2**60)),
    "bytes of an exabyte": proto4(b"\x8e" + struct.pack("<Q", 2**63)),
    "negative length": proto2(b"T" + struct.pack("<i", -5)),
    "memo never filled": proto2(b"h\x07"),
    "empty stack": proto2(b""),
    "mark as a value": proto2(b"("),
    "mark in a tuple": proto2(b"(\x85"),
    "mark popped": proto2(b"(0"),
    "missing mark": proto2(b"]e"),
    "append to a dict": proto2(b"}K\x01a"),
    "members of a list": proto2(b"]K\x01K\x02s"),
    "odd members": proto2(b"}(K\x01u"),
    "list as a key": proto2(b"}]K\x02s"),
    "tuple as a key": proto2(b"})K\x02s"),
    "too short for a tuple": proto2(b"K\x01\x86"),
    "call of a number": proto2(b"K\x01)R"),
    "call without a tuple": proto4(name("builtins", "dict") + b"K\x01R"),
    "name of a number": proto4(b"K\x01K\x02\x93"),
    "a name as the value": proto4(name("builtins", "dict")),
    "unknown instruction": b"\x80\x04\xff.",
    "a number of 5,000 digits": b"I" + b"9" * 5000 + b"\n.",
    "unknown escape": b"S'\\ '\n.",
    "bad escape": b"S'\\x'\n.",
    "bad utf-8": proto4(b"\x8c\x01\xff"),
    "array larger than its data": proto4(array_state(b"J\xff\xff\xff\x7f\x85")),
    "array of negative length": proto4(array_state(b"J\xff\xff\xff\xff\x85")),
    "array of sixty-four dimensions": proto4(array_state(b"(" + b"K\x01" * 64 + b"t", raw=b"12345678")),
    "array with a text for a shape": proto4(array_state(b"X\x01\x00\x00\x001")),
    "dtype with a shape": proto4(
        name("numpy", "dtype") + text("f8") + b"\x85R(K\x03" + text("<") + b"(K\x01K\x02tNNK\x00K\x00K\x00tb"
    ),
    "bytes in an unknown encoding": proto4(name("_codecs", "encode") + text("a") + text("idna") + b"\x86R"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_pickles_are_no_more_than_that(case: str) -> None:
    assert codes(BROKEN[case]) <= {"bad-annotations", "forbidden-pickle"}


def test_memo_bombs_take_no_memory() -> None:
    # An index of 2³¹ makes Python's own reader reserve 32 GiB.
    assert load(proto2(b"]r" + struct.pack("<I", 2**31) + b"0j" + struct.pack("<I", 2**31))) == []


def test_nesting_takes_no_recursion() -> None:
    depth = 20_000
    assert load(proto2(b"]" * depth + b"a" * (depth - 1))) != []


def test_containers_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evaluator.pickles.MAX_CONTAINERS", 100)
    assert load(pickle.dumps([[] for _ in range(99)])) == [[]] * 99
    assert codes(pickle.dumps([[] for _ in range(100)])) == {"too-large"}


def test_state_of_an_attribute_dict_is_only_data() -> None:
    data = proto4(
        name("foo", "EasyDict") + b")\x81}(" + text("__class__") + text("x") + text("update") + b"Nub"
    )
    found = load(data)
    assert type(found) is Attributes
    assert found == {"__class__": "x", "update": None}
    assert callable(found.update)


@settings(max_examples=300)
@given(data=st.binary(max_size=60))
@example(data=b"\x80\x04" + name("numpy", "dtype") + text("f8") + b"\x85R}b.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b")\x81Nb.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b")\x81K\x01b.")
@example(data=b"\x80\x04" + name("foo", "EasyDict") + b"K\x01\x85R.")
@example(data=b"\x80\x04" + name("_codecs", "encode") + text("a") + b"]\x86R.")
def test_no_bytes_raise_anything_but_a_rejection(data: bytes) -> None:
    try:
        load(data)
    except Rejected as rejected:
        found = {problem.code for problem in rejected.problems}
    else:
        found = set()
    assert found <= {"bad-annotations", "forbidden-pickle"}


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
    try:
        load(data)
    except Rejected as rejected:
        assert {problem.code for problem in rejected.problems} <= {"bad-annotations", "forbidden-pickle"}  # noqa: PT017 -- most bytes raise nothing
