"""Annotations of the object in the target frame, for offline analyses; scores and digests ignore them.

`occ_ratio` is the occluded part (0 to 1), `same_lane` whether the object is in the lane of the camera's car,
`box2d` x1, y1, x2, y2 as parts of the image's width and height.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats

OBJECT_COLUMNS: Final = ("occ_ratio", "same_lane", "box2d")

_LANES: Final = {"1": True, "true": True, "0": False, "false": False}
_FARTHEST: Final = 2.0  # a box may be partly outside the image; beyond this it is in pixels


@dataclass(frozen=True, eq=False)
class Objects:
    """Annotations as float64 arrays, NaN where missing; None without the column.

    `occ_ratio` and `same_lane` (1 or 0) have the shape `(n,)`, `box2d` has `(n, 4)`.
    """

    occ_ratio: Floats | None = None
    same_lane: Floats | None = None
    box2d: Floats | None = None

    def __repr__(self) -> str:
        stated = [name for name in OBJECT_COLUMNS if getattr(self, name) is not None]
        return f"Objects({', '.join(stated) or 'nothing stated'})"

    @classmethod
    def of(
        cls,
        *,
        occ_ratio: Sequence[float | None],
        same_lane: Sequence[bool | None],
        box2d: Sequence[Sequence[float] | None],
    ) -> Objects:
        """Read the columns of a table; an empty one is absent."""
        return cls(
            occ_ratio=_floats(occ_ratio),
            same_lane=_floats(same_lane),
            box2d=_floats([[math.nan] * 4 if box is None else box for box in box2d]),
        )

    def to_columns(self) -> tuple[list[float | None], list[bool | None], list[list[float] | None]]:
        """Return occlusion, lane and box of every sequence; None where there is none."""
        return (
            [None if math.isnan(value) else value for value in _items(self.occ_ratio)],
            [None if math.isnan(value) else value == 1 for value in _items(self.same_lane)],
            [None if math.isnan(box[0]) else box for box in _items(self.box2d)],
        )

    @property
    def box_height(self) -> Floats | None:
        """The heights of the boxes, as parts of the height of the image; None without boxes."""
        return None if self.box2d is None else self.box2d[:, 3] - self.box2d[:, 1]


def _items(column: Floats | None) -> list[Any]:
    return [] if column is None else column.tolist()


def _floats(column: Sequence[Any]) -> Floats | None:
    values: NDArray[np.float64] = np.array(column, dtype=np.float64)  # None becomes NaN
    if np.isnan(values).all():
        return None
    values.setflags(write=False)
    return values


# --- of a field of a CSV table: the value, or `ValueError` that says what was expected --------------------


def occ_ratio_of(text: str) -> float | None:
    """Parse the occluded part.

    >>> occ_ratio_of("0.25"), occ_ratio_of("")
    (0.25, None)
    """
    expected = "a number from 0 to 1, or nothing"
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise ValueError(expected) from None
    if not 0 <= value <= 1:
        raise ValueError(expected)
    return value


def same_lane_of(text: str) -> bool | None:
    """Parse whether the object is in the same lane.

    >>> same_lane_of("1"), same_lane_of("False"), same_lane_of("")
    (True, False, None)
    """
    if not text:
        return None
    if text.lower() not in _LANES:
        raise ValueError("1, 0 or nothing")
    return _LANES[text.lower()]


def box2d_of(text: str) -> list[float] | None:
    """Parse four numbers with spaces between them.

    >>> box2d_of("0.25 0.25 0.5 0.75"), box2d_of("")
    ([0.25, 0.25, 0.5, 0.75], None)
    """
    if not text:
        return None
    try:
        box = [float(part) for part in text.split()]
    except ValueError:
        box = []
    if not is_box(box):
        raise ValueError(
            '"x1 y1 x2 y2" as parts of the width and height of the image, x1 < x2 and y1 < y2, or nothing'
        )
    return box


FIELDS: Final[dict[str, Callable[[str], Any]]] = {
    "occ_ratio": occ_ratio_of,
    "same_lane": same_lane_of,
    "box2d": box2d_of,
}


def text_of(value: float | bool | Sequence[float] | None) -> str:
    """Format a value as the functions above parse it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    return repr(value) if isinstance(value, float) else " ".join(map(repr, value))


def is_box(box: Sequence[float]) -> bool:
    if len(box) != 4 or not all(abs(number) <= _FARTHEST for number in box):  # NaN is not either
        return False
    x1, y1, x2, y2 = box
    return x1 < x2 and y1 < y2


# --- of an object of an annotation file: the value, or None for whatever else stands there ----------------


def plain_occ_ratio(value: object) -> float | None:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value <= 1:
        return float(value)
    return None


def plain_same_lane(value: object) -> bool | None:
    if isinstance(value, bool) or (isinstance(value, int | float) and value in (0, 1)):
        return bool(value)
    return None
