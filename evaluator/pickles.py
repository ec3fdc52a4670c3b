"""Reading a pickle without running it.

A pickle is a program for a small stack machine, and Python's own machine does whatever the program says.
This one builds plain containers, texts, numbers, numpy arrays of numbers and attribute-dicts, and nothing
else. The names that a program asks for are never imported: each is answered in `plain_values`, or it is the
name of a dict-like class and becomes `Attributes`, or the file is refused.

Time and memory are bounded by the size of the file and two counts. A pickle may mention one object as often
as it likes, so whatever walks an object (a copy, a state that is given to another object) first charges for
its members. Keys are short of 2^63, so that at most eight whole numbers have the same hash. Nothing nested is
ever hashed or compared: both recur, and a tuple can be nested deeper than the interpreter's stack.
"""

from __future__ import annotations

import pickletools
import struct
import warnings
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from evaluator.plain_values import (
    Attributes,
    Dtype,
    Name,
    expect,
    few_values,
    fill,
    memo_index,
    new_object,
    plain_key,
    resolve,
    short_text,
)
from evaluator.problems import Rejected, reject

MAX_CONTAINERS: Final = 5_000_000
MAX_COPIED: Final = 10_000_000
"""So many members may be copied from one object to another, and no more than the file has bytes."""

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


def load_plain(data: bytes, *, where: str) -> object:
    """The value that the pickle in `data` describes; raises `Rejected`, at `where`, for anything beyond plain
    data.

    Attribute-dicts come back as `Attributes`, numpy scalars as Python numbers, ordered and default dicts as
    dicts.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an escape that no pickle ever wrote
            return _Machine(max_copied=min(MAX_COPIED, len(data))).run(data)
    except Rejected as rejected:
        problem = rejected.problems[0]
        raise reject(problem.code, problem.message, where) from None
    except _FAULTS as error:
        fault = str(error)[:200]
        raise reject("bad-annotations", f"The file is no intact pickle ({fault}).", where) from None


class _Machine:
    """The stack machine. One method per family of opcodes; `_OPCODES` says which."""

    def __init__(self, *, max_copied: int) -> None:
        self.stack: list[object] = []
        self.memo: dict[int, object] = {}
        self.n_containers = 0
        self.n_copied = 0
        self.max_copied = max_copied

    def run(self, data: bytes) -> object:
        for opcode, argument, _position in pickletools.genops(data):
            handle = _OPCODES.get(opcode.name)
            if handle is None:
                raise reject(
                    "forbidden-pickle", f"The pickle uses the instruction {opcode.name}; expected plain data."
                )
            handle(self, argument)
        value = self.stack.pop()
        if isinstance(value, Name | Dtype) or value is _MARK:
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

    def charge(self, value: object) -> None:
        """Count the members of `value`, which are about to be copied; eight bytes are one."""
        if isinstance(value, str | bytes | bytearray):
            self.n_copied += len(value) // 8
        elif isinstance(value, list | tuple | dict | set):
            self.n_copied += len(value)
        if self.n_copied > self.max_copied:
            message = f"The pickle copies more than {self.max_copied:,} members from one object to another."
            raise reject("too-large", message)

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
        self.memo[len(self.memo) if index is None else memo_index(index)] = self.stack[-1]

    def get(self, index: object) -> None:
        self.stack.append(self.memo[memo_index(index)])

    # -- containers
    # ---------------------------------------------------------------------------------------------

    def tuple_of(self, n: int) -> None:
        items = [self.pop() for _ in range(n)]
        self.push_container(tuple(reversed(items)))

    def append(self, items: list[object]) -> None:
        expect(self.stack[-1], list).extend(items)

    def set_items(self, items: list[object]) -> None:
        target = self.stack[-1]
        if not isinstance(target, dict) or len(items) % 2:
            raise ValueError("members are given to something that is no dictionary")
        target.update(zip(map(plain_key, items[::2]), items[1::2], strict=True))

    def dictionary(self) -> None:
        items = self.pop_mark()
        self.push_container({})
        self.set_items(items)

    def add_items(self, items: list[object]) -> None:
        expect(self.stack[-1], set).update(map(plain_key, items))

    # -- names, calls, states
    # -----------------------------------------------------------------------------------

    def name(self, module: object, name: object) -> None:
        self.stack.append(resolve(short_text(module), short_text(name)))

    def call(self, function: object, arguments: object) -> None:
        self.push_container(expect(function, Name).make(*self.charged(arguments)))

    def new_object(self, cls: object, arguments: object) -> None:
        self.push_container(new_object(cls, *self.charged(arguments)))

    def charged(self, arguments: object) -> tuple[object, ...]:
        """The arguments of a call, with what it may copy of them counted."""
        few = few_values(arguments)
        for argument in few:
            self.charge(argument)
        return few

    def build(self, _argument: object) -> None:
        state = self.stack.pop()
        target = self.stack[-1]
        if isinstance(target, Attributes):
            for part in self.charged(state if isinstance(state, tuple) else (state,)):
                for key, value in expect(part, dict).items() if part is not None else ():
                    target.setdefault(plain_key(key), value)
        elif isinstance(target, Dtype):
            target.build(state)
        elif isinstance(target, np.ndarray):
            fill(target, self.charged(state))
        else:
            raise reject("forbidden-pickle", "The pickle sets the state of an object; expected plain data.")


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
    "FROZENSET": lambda machine, _: machine.push_container(set(map(plain_key, machine.pop_mark()))),
    "GLOBAL": lambda machine, argument: machine.name(*argument.split(" ", 1)),
    "STACK_GLOBAL": lambda machine, _: machine.name(*machine.pop_two()),
    "REDUCE": lambda machine, _: machine.call(*machine.pop_two()),
    "NEWOBJ": lambda machine, _: machine.new_object(*machine.pop_two()),
    "BUILD": _Machine.build,
}
"""What each instruction does. Persistent ids, extensions and instances made by INST or OBJ are refused."""
