"""Check the arguments of public functions: a file in any of its forms, and objects of the right type."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, Any, Final

from evaluator.problems import reject

Source = str | os.PathLike[str] | bytes | bytearray | memoryview | IO[bytes] | IO[str]
"""A path, the content, or an open file."""

_EXPECTED: Final = "expected a path, bytes or an open file"
# What a person most likely holds, where something else is wanted.
_HINTS: Final = {
    "Predictions": "read_predictions(file, manifest=…), or Predictions.from_arrays(ttc_s=…, manifest=…)",
    "GroundTruth": "read_truth(file)",
    "Manifest": "read_manifest(file), or the manifest of a GroundTruth",
}


def data_of(source: Source) -> bytes:
    """Read the bytes of a file; raises `Rejected` if it is unreadable, `TypeError` for other objects."""
    if isinstance(source, bytes):
        return source
    if isinstance(source, bytearray | memoryview):
        return bytes(source)
    if isinstance(source, str) and source.lstrip().startswith(("{", "[")):
        raise TypeError(f"source is JSON text; {_EXPECTED}. Give its bytes: text.encode().")
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        try:
            return path.read_bytes()
        except OSError as error:
            raise reject("unreadable", f"The file cannot be read: {error.strerror}.", path.name) from None
    read: Any = getattr(source, "read", None)
    if not callable(read):
        raise TypeError(f"source is {_kind(source)}; {_EXPECTED}.")
    content = read()
    return content.encode() if isinstance(content, str) else bytes(content)


def require(value: object, wanted: type, *, name: str) -> None:
    """Raise `TypeError` that says what was found, what was expected and how to get it."""
    if not isinstance(value, wanted):
        hint = _HINTS.get(wanted.__name__, "")
        how = f": {hint}" if hint else ""
        raise TypeError(f"{name} is {_kind(value)}; expected {wanted.__name__}{how}.")


def _kind(value: object) -> str:
    if value is None:
        return "None"
    cls = type(value)
    package = cls.__module__.partition(".")[0]
    return f"of type {cls.__name__ if package in ('builtins', 'evaluator') else f'{package}.{cls.__name__}'}"
