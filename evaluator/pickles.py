"""Reading a pickle without running it.

A pickle is a program for a small stack machine, and Python's own machine does whatever the program says.
This one builds plain containers, texts, numbers, numpy arrays of numbers and attribute-dicts, and nothing
else. The names that a program asks for are never imported: each is answered from `_MAKERS`, or it is the name
of a dict-like class and becomes `Attributes`, or the file is refused. Keys are scalars, so that no hash can
be made expensive; memory is bounded by the size of the file and the number of containers.
"""

from __future__ import annotations

import math
import pickletools
import re
import struct
import sys
import warnings
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from evaluator.problems import Rejected, quoted, reject

MAX_CONTAINERS: Final = 5_000_000

_DICT_LIKE_NAMES: Final = ("dict", "munch", "bunch", "box", "namespace")
_NUMERIC: Final = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|c8|c16)")
_FAULTS: Final = (
    Warning,
    ValueError,
    IndexError,
    KeyError,
    TypeError,
    AttributeError,
    OverflowError,
    struct.error,
)
_MARK: Final = object()

Array = np.ndarray[Any, np.dtype[Any]]
_SCALARS: Final = (str, bytes, int, float, bool, type(None))


class Attributes(dict[Any, Any]):
    """An attribute-dict of whatever class, as plain data."""


class _Name:
    """A name the pickle asked for, with what our machine does when it is called."""

    def __init__(self, name: str, make: Callable[..., object]) -> None:
        self.name = name
        self.make = make


class _Dtype:
    """A numpy dtype under construction; real ones are shared and must not be changed by a file."""

    def __init__(self, text: object, *_flags: object) -> None:
        name = _expect(text, str)
        if not _NUMERIC.fullmatch(name):
            raise reject(
                "forbidden-pickle", f"The pickle has an array of type {quoted(name)}; expected numbers."
            )
        self.value = np.dtype(name)

    def build(self, state: object) -> None:
        _version, order, *rest = _expect(state, tuple)
        if order not in {"<", ">", "|", "="} or any(part not in {None, -1, 0} for part in rest):
            raise ValueError("a dtype of unknown construction")
        self.value = self.value.newbyteorder(order)


def load_plain(data: bytes, *, where: str) -> object:
    """The value that the pickle in `data` describes; raises `Rejected`, at `where`, for anything beyond plain
    data.

    Attribute-dicts come back as `Attributes`, numpy scalars as Python numbers, ordered and default dicts as
    dicts.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an escape that no pickle ever wrote
            return _Machine().run(data)
    except Rejected as rejected:
        problem = rejected.problems[0]
        raise reject(problem.code, problem.message, where) from None
    except _FAULTS as error:
        raise reject("bad-annotations", f"The file is no intact pickle ({error}).", where) from None


class _Machine:
    """The stack machine. One method per family of opcodes; `_OPCODES` says which."""

    def __init__(self) -> None:
        self.stack: list[object] = []
        self.memo: dict[int, object] = {}
        self.n_containers = 0

    def run(self, data: bytes) -> object:
        for opcode, argument, _position in pickletools.genops(data):
            handle = _OPCODES.get(opcode.name)
            if handle is None:
                raise reject(
                    "forbidden-pickle", f"The pickle uses the instruction {opcode.name}; expected plain data."
                )
            handle(self, argument)
        value = self.stack.pop()
        if isinstance(value, _Name | _Dtype) or value is _MARK:
            raise ValueError("it describes no value")
        return value

    # -- the stack
    # ----------------------------------------------------------------------------------------------

    def nothing(self, _argument: object) -> None:
        """PROTO, FRAME, STOP."""

    def push(self, argument: object) -> None:
        self.stack.append(argument)

    def push_container(self, value: object) -> None:
        self.n_containers += 1
        if self.n_containers > MAX_CONTAINERS:
            raise reject("too-large", f"The pickle has more than {MAX_CONTAINERS:,} containers.")
        self.stack.append(value)

    def pop(self) -> object:
        value = self.stack.pop()
        if value is _MARK:
            raise ValueError("a value is missing")
        return value

    def pop_two(self) -> list[object]:
        second = self.pop()
        return [self.pop(), second]

    def pop_mark(self) -> list[object]:
        """Everything above the topmost mark; the mark goes too."""
        at = len(self.stack) - 1
        while self.stack[at] is not _MARK:
            at -= 1
            if at < 0:
                raise ValueError("a mark is missing")
        items = self.stack[at + 1 :]
        del self.stack[at:]
        return items

    def put(self, index: object) -> None:
        self.memo[len(self.memo) if index is None else _expect(index, int)] = self.stack[-1]

    def get(self, index: object) -> None:
        self.stack.append(self.memo[_expect(index, int)])

    # -- containers
    # ---------------------------------------------------------------------------------------------

    def tuple_of(self, n: int) -> None:
        items = [self.pop() for _ in range(n)]
        self.push_container(tuple(reversed(items)))

    def append(self, items: list[object]) -> None:
        _expect(self.stack[-1], list).extend(items)

    def set_items(self, items: list[object]) -> None:
        target = self.stack[-1]
        if not isinstance(target, dict) or len(items) % 2:
            raise ValueError("members are given to something that is no dictionary")
        target.update(zip(map(_key, items[::2]), items[1::2], strict=True))

    def dictionary(self) -> None:
        items = self.pop_mark()
        self.push_container({})
        self.set_items(items)

    def add_items(self, items: list[object]) -> None:
        _expect(self.stack[-1], set).update(map(_key, items))

    # -- names, calls, states
    # -----------------------------------------------------------------------------------

    def name(self, module: object, name: object) -> None:
        self.stack.append(_resolve(_expect(module, str), _expect(name, str)))

    def call(self, function: object, arguments: object) -> None:
        self.push_container(_expect(function, _Name).make(*_expect(arguments, tuple)))

    def new_object(self, cls: object, arguments: object) -> None:
        self.push_container(_new_object(cls, *_expect(arguments, tuple)))

    def build(self, _argument: object) -> None:
        state = self.stack.pop()
        target = self.stack[-1]
        if isinstance(target, Attributes):
            for part in state if isinstance(state, tuple) else (state,):
                for key, value in _expect(part, dict).items() if part is not None else ():
                    target.setdefault(_key(key), value)
        elif isinstance(target, _Dtype):
            target.build(state)
        elif isinstance(target, np.ndarray):
            _fill(target, state)
        else:
            raise reject("forbidden-pickle", "The pickle sets the state of an object; expected plain data.")


def _resolve(module: str, name: str) -> _Name:
    known = _MAKERS.get((_ALIASES.get(module, module), name))
    full_name = f"{module}.{name}"
    if known is not None:
        return _Name(full_name, known)
    is_dict_like = name.lower().endswith(_DICT_LIKE_NAMES)
    if is_dict_like and module.partition(".")[0] not in sys.stdlib_module_names and "." not in name:
        return _Name(full_name, _attributes)
    message = (
        f"The pickle asks for {quoted(full_name)}; expected plain containers, numbers and attribute-dicts."
    )
    raise reject("forbidden-pickle", message)


def _attributes(*arguments: object) -> Attributes:
    return Attributes(_dictionary(*arguments))


def _dictionary(*arguments: object) -> dict[object, object]:
    if not arguments:
        return {}
    (content,) = arguments
    pairs = (
        content.items()
        if isinstance(content, dict)
        else [_expect(pair, list | tuple) for pair in _expect(content, list)]
    )
    return {_key(key): value for key, value in pairs}


def _default_dictionary(*_factory: object) -> dict[object, object]:
    return {}


def _new_object(cls: object, *arguments: object) -> object:
    maker = _expect(cls, _Name).make
    if maker is not _attributes and maker is not _dictionary:
        raise reject(
            "forbidden-pickle", f"The pickle makes a {quoted(_expect(cls, _Name).name)}; expected plain data."
        )
    return maker(*arguments)


def _reconstructor(cls: object, _base: object, content: object) -> object:
    return _new_object(cls, *([] if content is None else [content]))


def _encode(text: object, encoding: object = "latin1") -> bytes:
    if encoding not in {"latin1", "latin-1"}:
        raise ValueError("bytes in an unknown encoding")
    return bytes(_expect(text, str).encode("latin-1"))


def _empty_bytes() -> bytes:
    """How old pickles write b""; a length or a list would be somebody else's idea."""
    return b""


def _list(items: object = ()) -> list[object]:
    return list(_expect(items, list | tuple))


def _set(items: object = ()) -> set[object]:
    return set(map(_key, _expect(items, list | tuple)))


def _no_call(*_arguments: object) -> object:
    raise reject("forbidden-pickle", "The pickle calls a type that it may only mention; expected plain data.")


def _empty_array(_cls: object, _shape: object, _typecode: object) -> Array:
    return np.zeros(0)


def _fill(array: Any, state: object) -> None:
    _version, shape, dtype, is_fortran, raw = _expect(state, tuple)
    kind = _expect(dtype, _Dtype).value
    _check_size(shape, kind, raw)
    array.__setstate__((1, shape, kind, bool(is_fortran), bytes(raw)))


def _from_buffer(raw: object, dtype: object, shape: object, order: object) -> Array:
    kind = _expect(dtype, _Dtype).value
    _check_size(shape, kind, raw)
    flat = np.frombuffer(bytes(_expect(raw, bytes | bytearray)), dtype=kind)
    return flat.reshape(_expect(shape, tuple), order="F" if order == "F" else "C")


def _check_size(shape: object, kind: np.dtype[Any], raw: object) -> None:
    lengths = [_expect(length, int) for length in _expect(shape, tuple)]
    size = len(_expect(raw, bytes | bytearray))
    if len(lengths) > 8 or min(lengths, default=0) < 0 or math.prod(lengths) * kind.itemsize != size:
        raise ValueError("an array whose shape does not fit its data")


def _scalar(dtype: object, raw: object) -> object:
    kind = _expect(dtype, _Dtype).value
    _check_size((), kind, raw)
    return np.frombuffer(bytes(_expect(raw, bytes | bytearray)), dtype=kind)[0].item()


def _key(key: object) -> object:
    if type(key) not in _SCALARS:
        raise ValueError("a key that is no text or number")
    return key


def _expect(value: Any, kind: Any) -> Any:
    if not isinstance(value, kind):
        raise ValueError(f"a {type(value).__name__} in an unexpected place")
    return value


_ALIASES: Final = {
    "__builtin__": "builtins",
    "copy_reg": "copyreg",
    "numpy.core.multiarray": "numpy._core.multiarray",
    "numpy.core.numeric": "numpy._core.numeric",
}

_MAKERS: Final[dict[tuple[str, str], Callable[..., object]]] = {
    ("builtins", "dict"): _dictionary,
    ("builtins", "list"): _list,
    ("builtins", "set"): _set,
    ("builtins", "frozenset"): _set,
    ("builtins", "object"): _no_call,
    ("builtins", "int"): _no_call,
    ("builtins", "float"): _no_call,
    ("collections", "OrderedDict"): _dictionary,
    ("collections", "defaultdict"): _default_dictionary,
    ("copyreg", "_reconstructor"): _reconstructor,
    ("copyreg", "__newobj__"): _new_object,
    ("builtins", "bytes"): _empty_bytes,
    ("_codecs", "encode"): _encode,
    ("numpy", "dtype"): _Dtype,
    ("numpy", "ndarray"): _no_call,
    ("numpy._core.multiarray", "_reconstruct"): _empty_array,
    ("numpy._core.multiarray", "scalar"): _scalar,
    ("numpy._core.numeric", "_frombuffer"): _from_buffer,
}

_Handler = Callable[[_Machine, Any], object]

_OPCODES: Final[dict[str, _Handler]] = {
    **dict.fromkeys(("PROTO", "FRAME", "STOP"), _Machine.nothing),
    **dict.fromkeys(
        (
            *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
            *(
                "STRING",
                "BINSTRING",
                "SHORT_BINSTRING",
                "UNICODE",
                "BINUNICODE",
                "SHORT_BINUNICODE",
                "BINUNICODE8",
            ),
            *("BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
        ),
        _Machine.push,
    ),
    "NONE": lambda machine, _: machine.push(None),
    "NEWTRUE": lambda machine, _: machine.push(True),
    "NEWFALSE": lambda machine, _: machine.push(False),
    "MARK": lambda machine, _: machine.push(_MARK),
    "POP": lambda machine, _: machine.pop(),
    "POP_MARK": lambda machine, _: machine.pop_mark(),
    "DUP": lambda machine, _: machine.push(machine.stack[-1]),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE"), _Machine.put),
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), _Machine.get),
    "EMPTY_LIST": lambda machine, _: machine.push_container([]),
    "LIST": lambda machine, _: machine.push_container(machine.pop_mark()),
    "APPEND": lambda machine, _: machine.append([machine.pop()]),
    "APPENDS": lambda machine, _: machine.append(machine.pop_mark()),
    "EMPTY_TUPLE": lambda machine, _: machine.push_container(()),
    "TUPLE": lambda machine, _: machine.push_container(tuple(machine.pop_mark())),
    "TUPLE1": lambda machine, _: machine.tuple_of(1),
    "TUPLE2": lambda machine, _: machine.tuple_of(2),
    "TUPLE3": lambda machine, _: machine.tuple_of(3),
    "EMPTY_DICT": lambda machine, _: machine.push_container({}),
    "DICT": lambda machine, _: machine.dictionary(),
    "SETITEM": lambda machine, _: machine.set_items(machine.pop_two()),
    "SETITEMS": lambda machine, _: machine.set_items(machine.pop_mark()),
    "EMPTY_SET": lambda machine, _: machine.push_container(set()),
    "ADDITEMS": lambda machine, _: machine.add_items(machine.pop_mark()),
    "FROZENSET": lambda machine, _: machine.push_container(set(map(_key, machine.pop_mark()))),
    "GLOBAL": lambda machine, argument: machine.name(*argument.split(" ", 1)),
    "STACK_GLOBAL": lambda machine, _: machine.name(*machine.pop_two()),
    "REDUCE": lambda machine, _: machine.call(*machine.pop_two()),
    "NEWOBJ": lambda machine, _: machine.new_object(*machine.pop_two()),
    "BUILD": _Machine.build,
}
"""What each instruction does. Persistent ids, extensions and instances made by INST or OBJ are refused."""
