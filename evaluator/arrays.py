"""Numbers from arrays, lists, tensors of torch and Series of pandas, recognised without imports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# Imported here: `np.ma` imports it at its first use, and the process that reads files can open nothing then.
from numpy import ma
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def as_floats(values: Any) -> Floats:
    """Convert to float64 of the same shape; a tensor may have bfloat16, a gradient and any device.

    Masked entries become NaN: there is no value. Raises `TypeError` for what is no real number: texts,
    booleans, complex numbers, dates, durations.
    """
    if hasattr(values, "detach"):
        if "complex" in str(getattr(values, "dtype", "")):
            raise TypeError(f"The values are of type {values.dtype}; expected real numbers.")
        values = values.detach().cpu().double()  # on the CPU first: not every device has float64
    elif isinstance(values, list | tuple) and values and hasattr(values[0], "detach"):
        values = [as_floats(value) for value in values]
    array = ma.asanyarray(values) if isinstance(values, ma.MaskedArray) else _array(values)
    kind = _kind_of_others(array)
    if kind:
        raise TypeError(f"The values are of type {kind}; expected real numbers.")
    if isinstance(array, ma.MaskedArray):
        return np.asarray(ma.filled(array.astype(np.float64), np.nan))
    try:
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        type_name = type(values if array.ndim == 0 else array.flat[0]).__name__
        raise TypeError(f"The values are of type {type_name}; expected real numbers of float64.") from None


def _kind_of_others(array: NDArray[Any]) -> str:
    """Name the type of values that are no real numbers, though numpy would convert them; else empty."""
    if array.dtype.kind in "cmMbSUV":
        return str(array.dtype)
    # An array of objects converts each of them by itself.
    others = (each for each in array.flat if isinstance(each, str | bytes | bool | np.bool_))
    other = next(others, None) if array.dtype.kind == "O" else None
    return "" if other is None else type(other).__name__


def _array(values: Any) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except ValueError:
        raise ValueError("The values are lists of different lengths; expected numbers.") from None


def whole_numbers(values: Any, *, name: str) -> NDArray[np.int64]:
    """Convert rows or other indices to int64 of the same shape; raises `TypeError` for floats and masks."""
    if isinstance(values, list | tuple) and values and hasattr(values[0], "detach"):
        return np.array([whole_numbers(value, name=name) for value in values])
    if hasattr(values, "detach"):
        values = values.detach().cpu()
        kind = str(values.dtype)
        is_whole = "int" in kind
    else:
        values = np.asarray(values)
        kind, is_whole = str(values.dtype), values.dtype.kind in "iu" or values.size == 0
    if not is_whole:
        raise TypeError(
            f"{name} are of type {kind}; expected whole numbers, such as rows of the ground truth."
        )
    return np.asarray(values).astype(np.int64)


def in_row_order(values: Any, *, name: str, anno_id: NDArray[np.int64] | None) -> Floats:
    """Copy one number per sequence, in the order of `anno_id` (the manifest's; None: any order).

    Raises `TypeError` for a dict, `ValueError` for a Series whose index is neither 0, 1, 2, … nor these
    anno_ids.
    """
    if isinstance(values, Mapping):
        raise TypeError(
            f"{name} is of type {type(values).__name__}; expected one number for each sequence, in the "
            f"manifest's order. For values by key, give write_predictions keys=list(d) and "
            f"{name}=list(d.values()), and its bytes to read_predictions."
        )
    index: Any = getattr(values, "index", None)
    is_series = index is not None and not callable(index) and hasattr(values, "to_numpy")
    if anno_id is not None and is_series and len(index) == len(anno_id):
        _require_row_order(list(index), names_sequences=index.name == "anno_id", name=name, anno_id=anno_id)
    return np.array(as_floats(values))


def _require_row_order(
    labels: list[Any], *, names_sequences: bool, name: str, anno_id: NDArray[np.int64]
) -> None:
    own, rows = anno_id.tolist(), list(range(len(labels)))
    if labels == own or (labels == rows and not names_sequences):
        return
    expected = own if names_sequences else rows
    raise ValueError(
        f"{name} is a Series with the index {_begin(labels)}; expected {_begin(expected)}, one row for each "
        "sequence in the manifest's order, because values are taken by their place. Sort it and give "
        f"{name}.to_numpy(), or give a frame with anno_id to evaluator.frames.predictions_from_frame."
    )


def _begin(labels: Sequence[object]) -> str:
    return ", ".join(map(str, labels[:3])) + (", …" if len(labels) > 3 else "")
