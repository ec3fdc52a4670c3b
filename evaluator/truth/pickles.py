"""Reading a pickle that names only data."""

# Every name in a pickle is answered by Python's containers or a class of this module, so nothing is imported.
# Each class has a `__setstate__`, so that the unpickler changes no lasting attribute. Memory and time are
# **not** limited here, but in the process of `annotation_child`.

from __future__ import annotations

import io
import pickle
import re
import sys
from typing import Any, Final, NoReturn

import numpy as np

from evaluator.problems import Rejected, quoted, reject

_MAX_NAME: Final = 200
_MAX_BYTES: Final = 64
_N_STATES: Final = 5
_DICT_LIKE_NAMES: Final = ("dict", "munch", "bunch", "box", "namespace")
_NUMERIC: Final = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|c8|c16)")


def load_plain(data: bytes, *, where: str) -> object:
    """Load a pickle of plain data; raises `Rejected` at `where` for anything else, and MemoryError."""
    # Attribute-dicts become `Attributes`, numpy scalars numbers, other dicts dicts, arrays `FewNumbers`.
    try:
        # A buffered reader can be peeked into, so that the unpickler does not ask for each few bytes.
        return _Unpickler(io.BufferedReader(io.BytesIO(data)), encoding="latin-1").load()
    except Rejected as rejected:
        problem = rejected.problems[0]
        raise reject(problem.code, problem.message, where) from None
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 -- "including, but not necessarily limited to", says the manual
        fault = str(error)[:200]
        raise reject("bad-annotations", f"The file is not an intact pickle ({fault}).", where) from None


class Attributes(dict[Any, Any]):
    """An attribute-dict of whatever class, as plain data."""

    __slots__ = ()

    def __setstate__(self, state: Any) -> None:
        # Foreign classes may keep their items as attributes.
        for part in state if isinstance(state, tuple) else (state,):
            for name, value in dict(part or {}).items():
                self.setdefault(name, value)


class FewNumbers:
    """An array of numbers; only a short one, such as a box, keeps its values."""

    __slots__ = ("_dtype", "_raw")
    _raw: bytes
    _dtype: _Dtype | None

    def __new__(cls, *arguments: object) -> FewNumbers:
        self = super().__new__(cls)
        self._keep(*arguments[:2])  # bytes and dtype of `_frombuffer`
        return self

    def __setstate__(self, state: Any) -> None:
        if isinstance(state, tuple) and len(state) == _N_STATES:
            self._keep(state[4], state[2])  # of (version, shape, dtype, order of the axes, bytes)

    def _keep(self, raw: object = None, dtype: object = None) -> None:
        self._raw, self._dtype = b"", None
        if isinstance(raw, bytes | bytearray) and len(raw) <= _MAX_BYTES and isinstance(dtype, _Dtype):
            self._raw, self._dtype = bytes(raw), dtype

    @property
    def numbers(self) -> list[float] | None:
        """The numbers as stored, without shape; None for a long array."""
        if self._dtype is None:
            return None
        try:
            return [float(number) for number in np.frombuffer(self._raw, self._dtype.kind).tolist()]
        except (ValueError, TypeError):  # a part of a number, or a complex one
            return None


class _Dtype:
    # Not numpy's type, which all arrays of a program share.

    __slots__ = ("kind",)
    kind: np.dtype[Any]

    def __new__(cls, name: str, *_flags: object) -> _Dtype:
        if not _NUMERIC.fullmatch(name):
            message = f"The pickle has an array of type {quoted(name)}; expected numbers."
            raise reject("forbidden-pickle", message)
        self = super().__new__(cls)
        self.kind = np.dtype(name)
        return self

    def __setstate__(self, state: Any) -> None:
        order = state[1]
        if order not in ("<", ">", "|", "="):  # a tuple: nothing is hashed
            raise ValueError("a dtype of unknown construction")
        self.kind = self.kind.newbyteorder(order)


class _Made:
    """A class whose calls make other objects; neither has state."""

    __slots__ = ()

    def __setstate__(self, _state: object) -> None: ...


class _Scalar(_Made):
    def __new__(cls, dtype: _Dtype, raw: bytes) -> Any:
        [number] = np.frombuffer(raw, dtype.kind).tolist()
        return number


class _DefaultDict(_Made):
    def __new__(cls, *_factory: object) -> Any:
        return {}


class _Encoded(_Made):
    # Old pickles write bytes as a text to encode as Latin-1, or nothing.

    def __new__(cls, text: str = "", _encoding: object = None) -> Any:
        return str.encode(text, "latin-1")


class _Reconstructed(_Made):
    # Old pickles make an object from its class, the base of its class, and the base's content.

    def __new__(cls, made: Any, *base_and_content: Any) -> Any:
        return made(*(content for content in base_and_content[1:] if content is not None))


_ALIASES: Final = {
    "__builtin__": "builtins",
    "copy_reg": "copyreg",
    "numpy.core.multiarray": "numpy._core.multiarray",
    "numpy.core.numeric": "numpy._core.numeric",
}

_ALLOWED: Final[dict[tuple[str, str], type]] = {
    ("builtins", "dict"): dict,
    ("builtins", "list"): list,
    ("builtins", "set"): set,
    ("builtins", "frozenset"): frozenset,
    ("builtins", "object"): object,
    ("builtins", "int"): object,  # mentioned as the factory of a default dict, and never called
    ("builtins", "float"): object,
    ("builtins", "bytes"): _Encoded,
    ("_codecs", "encode"): _Encoded,
    ("collections", "OrderedDict"): dict,
    ("collections", "defaultdict"): _DefaultDict,
    ("copyreg", "_reconstructor"): _Reconstructed,
    ("copyreg", "__newobj__"): _Reconstructed,  # which has a class and no base; __new__ needs no more
    ("numpy", "dtype"): _Dtype,
    ("numpy", "ndarray"): object,
    ("numpy._core.multiarray", "_reconstruct"): FewNumbers,
    ("numpy._core.multiarray", "scalar"): _Scalar,
    ("numpy._core.numeric", "_frombuffer"): FewNumbers,
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> type:
        allowed = _ALLOWED.get((_ALIASES.get(module, module), name))
        if allowed is not None:
            return allowed
        if max(len(module), len(name)) > _MAX_NAME:
            raise ValueError(f"a name of more than {_MAX_NAME} characters")
        is_dict_like = name.lower().endswith(_DICT_LIKE_NAMES)
        if is_dict_like and module.partition(".")[0] not in sys.stdlib_module_names and "." not in name:
            return Attributes
        asked = quoted(f"{module}.{name}")
        message = f"The pickle asks for {asked}; expected plain containers, numbers and attribute-dicts."
        raise reject("forbidden-pickle", message)

    def persistent_load(self, _pid: object) -> NoReturn:
        message = "The pickle asks for an object that is kept elsewhere; expected plain data."
        raise reject("forbidden-pickle", message)
