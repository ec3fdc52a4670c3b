"""What a pickle may make: attribute-dicts, plain containers, bytes, and numpy's arrays and numbers.

Every name that a pickle asks for is answered here, by a function of ours; nothing is imported for it.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from evaluator.problems import quoted, reject

_MAX_KEY: Final = 2**63
_MIN_KEY: Final = 2.0**-30
_MAX_NAME: Final = 200
_MAX_ARGUMENTS: Final = 9  # the state of a dtype has so many

_DICT_LIKE_NAMES: Final = ("dict", "munch", "bunch", "box", "namespace")
_NUMERIC: Final = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|c8|c16)")

Array = np.ndarray[Any, np.dtype[Any]]
_SCALARS: Final = (str, bytes, int, float, bool, type(None))


class Attributes(dict[Any, Any]):
    """An attribute-dict of whatever class, as plain data."""


class Name:
    """A name the pickle asked for, with what our machine does when it is called."""

    def __init__(self, name: str, make: Callable[..., object]) -> None:
        self.name = name
        self.make = make


class Dtype:
    """A numpy dtype under construction; real ones are shared and must not be changed by a file."""

    def __init__(self, text: object, *_flags: object) -> None:
        name = short_text(text)
        if not _NUMERIC.fullmatch(name):
            raise reject(
                "forbidden-pickle", f"The pickle has an array of type {quoted(name)}; expected numbers."
            )
        self.value = np.dtype(name)

    def build(self, state: object) -> None:
        _version, order, *rest = few_values(state)
        is_plain = all(part is None or (type(part) is int and part in {-1, 0}) for part in rest)
        if short_text(order) not in {"<", ">", "|", "="} or not is_plain:
            raise ValueError("a dtype of unknown construction")
        self.value = self.value.newbyteorder(order)  # type: ignore[arg-type]  # one of these four, as said above


def resolve(module: str, name: str) -> Name:
    """What a name that the pickle asks for stands for; raises `Rejected` for anything that is not data."""
    known = _MAKERS.get((_ALIASES.get(module, module), name))
    full_name = f"{module}.{name}"
    if known is not None:
        return Name(full_name, known)
    is_dict_like = name.lower().endswith(_DICT_LIKE_NAMES)
    if is_dict_like and module.partition(".")[0] not in sys.stdlib_module_names and "." not in name:
        return Name(full_name, _attributes)
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
        else [expect(pair, list | tuple) for pair in expect(content, list)]
    )
    return {plain_key(key): value for key, value in pairs}


def _default_dictionary(*_factory: object) -> dict[object, object]:
    return {}


def new_object(cls: object, *arguments: object) -> object:
    """What `cls.__new__` makes, for classes of dictionaries; raises `Rejected` for others."""
    maker = expect(cls, Name).make
    if maker is not _attributes and maker is not _dictionary:
        raise reject(
            "forbidden-pickle", f"The pickle makes a {quoted(expect(cls, Name).name)}; expected plain data."
        )
    return maker(*arguments)


def _reconstructor(cls: object, _base: object, content: object) -> object:
    return new_object(cls, *([] if content is None else [content]))


def _encode(text: object, encoding: object = "latin1") -> bytes:
    if short_text(encoding) not in {"latin1", "latin-1"}:
        raise ValueError("bytes in an unknown encoding")
    return bytes(expect(text, str).encode("latin-1"))


def _empty_bytes() -> bytes:
    """How old pickles write b""; a length or a list would be somebody else's idea."""
    return b""


def _list(items: object = ()) -> list[object]:
    return list(expect(items, list | tuple))


def _set(items: object = ()) -> set[object]:
    return set(map(plain_key, expect(items, list | tuple)))


def _no_call(*_arguments: object) -> object:
    raise reject("forbidden-pickle", "The pickle calls a type that it may only mention; expected plain data.")


def _empty_array(_cls: object, _shape: object, _typecode: object) -> Array:
    return np.zeros(0)


def fill(array: Any, state: object) -> None:
    """Give an empty array its state, once shape and data are known to fit."""
    _version, shape, dtype, is_fortran, raw = expect(state, tuple)
    kind = expect(dtype, Dtype).value
    _check_size(shape, kind, raw)
    array.__setstate__((1, shape, kind, bool(is_fortran), bytes(raw)))


def _from_buffer(raw: object, dtype: object, shape: object, order: object) -> Array:
    kind = expect(dtype, Dtype).value
    _check_size(shape, kind, raw)
    flat = np.frombuffer(bytes(expect(raw, bytes | bytearray)), dtype=kind)
    return flat.reshape(expect(shape, tuple), order="F" if order == "F" else "C")


def _check_size(shape: object, kind: np.dtype[Any], raw: object) -> None:
    lengths = [expect(length, int) for length in few_values(shape)]
    size = len(expect(raw, bytes | bytearray))
    if not all(0 <= length <= size for length in lengths) or math.prod(lengths) * kind.itemsize != size:
        raise ValueError("an array whose shape does not fit its data")


def _scalar(dtype: object, raw: object) -> object:
    kind = expect(dtype, Dtype).value
    _check_size((), kind, raw)
    return np.frombuffer(bytes(expect(raw, bytes | bytearray)), dtype=kind)[0].item()


def plain_key(key: object) -> object:
    """`key` if it is a text or a number that hashes cheaply; raises ValueError."""
    kind = type(key)
    if kind is str:  # most are
        return key
    if kind not in _SCALARS:
        raise ValueError("a key that is no text or number")
    if kind is int and not -_MAX_KEY < key < _MAX_KEY:  # type: ignore[operator]  # a number, as the line says
        raise ValueError("a whole-number key of 2^63 or more")
    if kind is float and key == key and key and not _MIN_KEY < abs(key) < _MAX_KEY:  # type: ignore[arg-type]  # noqa: PLR0124 -- as above; NaN alone differs from itself
        raise ValueError("a key that is no moderate number")
    return key


def memo_index(index: object) -> int:
    """The number under which a pickle remembers an object; raises ValueError."""
    number: int = expect(index, int)
    if not 0 <= number < _MAX_KEY:
        raise ValueError("a memo index of 2^63 or more")
    return number


def short_text(text: object) -> str:
    """`text` if it is as short as a name is; raises ValueError. It may be copied then."""
    found: str = expect(text, str)
    if len(found) > _MAX_NAME:
        raise ValueError(f"a name of {len(found):,} characters")
    return found


def few_values(values: object) -> tuple[object, ...]:
    """`values` if it is a tuple as short as a list of arguments is; raises ValueError."""
    found: tuple[object, ...] = expect(values, tuple)
    if len(found) > _MAX_ARGUMENTS:
        raise ValueError(f"a call with {len(found):,} values")
    return found


def expect(value: Any, kind: Any) -> Any:
    """`value` if it is of this kind; raises ValueError."""
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
    ("copyreg", "__newobj__"): new_object,
    ("builtins", "bytes"): _empty_bytes,
    ("_codecs", "encode"): _encode,
    ("numpy", "dtype"): Dtype,
    ("numpy", "ndarray"): _no_call,
    ("numpy._core.multiarray", "_reconstruct"): _empty_array,
    ("numpy._core.multiarray", "scalar"): _scalar,
    ("numpy._core.numeric", "_frombuffer"): _from_buffer,
}
