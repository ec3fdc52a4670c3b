"""SOT (paper, §6.1): track the target box back to the reference frame, then compare sizes."""

# The paper's OSTrack has no published weights. The default is median flow (Kalal, Mikolajczyk and Matas,
# "Forward-backward error", ICPR 2010) on pyramidal Lucas-Kanade, without weights; CSRT and NanoTrack are
# OpenCV's.

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import Measure, box_around, centre_of, is_usable, scale_ratio_of_boxes, size_of
from tsttc_baselines.clips import TARGET, Box, Clip, Image
from tsttc_baselines.estimates import Estimate, Unusable

TRACKERS: Final = ("median-flow", "csrt", "nano")
_NEVER_CHANGE_SIZE: Final = ("kcf", "mil")

_GRID: Final = 10
"""Points in each direction of the box."""

_INSET: Final = 0.1
"""The outermost points lie so far inside the box, in parts of its side: the edges show background."""

_WINDOW_PX: Final = 11
_LEVELS: Final = 3
_STOP: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
_MIN_EIGENVALUE: Final = 1e-3
"""OpenCV's `minEigThreshold`, ten times its default: smooth paint cannot be followed."""

_MIN_POINTS: Final = 8
_MAX_RETURN_ERROR: Final = 0.5
"""The object is lost where half of the points return farther than this from their start, in box sides."""

Points = NDArray[np.float32]


class TrackerRefused(ValueError):
    """A tracker that cannot be used here; the message names the reason and an alternative."""


@dataclass(frozen=True, slots=True)
class Tracking:
    """The baseline "SOT" with its parameters.

    `tracker` is one of `TRACKERS`; `measure` as in `tsttc_baselines.boxes`: areas in published rows,
    "sqrt-area" the scale ratio itself; `backbone` and `head` are paths of NanoTrack's ONNX models. Raises
    `TrackerRefused` if the tracker cannot be used.
    """

    tracker: str = "median-flow"
    measure: Measure = "sqrt-area"
    backbone: str | Path | None = None
    head: str | Path | None = None

    def __post_init__(self) -> None:
        if self.tracker in _NEVER_CHANGE_SIZE:
            raise TrackerRefused(
                f"The tracker {self.tracker!r} never changes the size of its box, "
                f"so every scale ratio would be 1; use one of {', '.join(TRACKERS)}."
            )
        if self.tracker not in TRACKERS:
            raise TrackerRefused(
                f"The tracker {self.tracker!r} is unknown; use one of {', '.join(TRACKERS)}."
            )
        if self.tracker != "median-flow":
            self._create()

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α over `frame_gap` frames; see `Estimator`."""
        # The confidence is the share of followed grid points (median flow), else 1.
        box = clip.boxes[TARGET]
        if not is_usable(box):
            raise Unusable("no box in the target frame")
        backwards = range(TARGET, TARGET - frame_gap - 1, -1)
        if self.tracker == "median-flow":
            tracked_box, confidence = median_flow([clip.grey(frame) for frame in backwards], box=box)
        else:
            frames = [clip.colour(frame) for frame in backwards]
            tracked_box, confidence = _follow(self._create(), frames, box=box), 1.0
        scale_ratio = float(scale_ratio_of_boxes(tracked_box, box, measure=self.measure))
        return Estimate(scale_ratio, confidence=confidence)

    def _create(self) -> Any:
        return _csrt() if self.tracker == "csrt" else _nano(self.backbone, self.head)


def median_flow(frames: list[Image], *, box: Box) -> tuple[Box, float]:
    """Track `box` (4,), in pixels, through grey frames: the last box, and the least share of points followed.

    Raises `Unusable` for too few points.
    """
    # In each step the box grows by the median ratio of the points' distances. Each point then predicts the
    # centre, and the median counts.
    confidence = 1.0
    for before, after in pairwise(frames):
        starts, ends = _followed(before, after, box)
        confidence = min(confidence, len(starts) / _GRID**2)
        growth = _growth(starts, ends)
        centre = np.median(ends - growth * (starts - centre_of(box)), axis=0)
        box = box_around(centre, size_of(box) * growth)
    return box, confidence


def _followed(before: Image, after: Image, box: Box) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return start and end (n, 2) of the half of the points that return closest to their start."""
    x0, y0, x1, y1 = _surroundings(box, before)
    first, second = before[y0:y1, x0:x1], after[y0:y1, x0:x1]
    starts = _grid(box - np.array([x0, y0, x0, y0]))
    ends, went = _flow(first, second, starts)
    returns, came = _flow(second, first, ends)
    error = np.linalg.norm(returns - starts, axis=1)
    is_followed = went & came
    if np.count_nonzero(is_followed) < _MIN_POINTS:
        raise Unusable("too few points could be followed")
    middle = float(np.median(error[is_followed]))
    if middle > _MAX_RETURN_ERROR * float(min(size_of(box))):
        raise Unusable("the tracker lost the object")
    is_followed &= error <= middle
    origin = np.array([x0, y0]) + 0.5
    return starts[is_followed] + origin, ends[is_followed] + origin


def _surroundings(box: Box, frame: Image) -> tuple[int, int, int, int]:
    """Return the part of the frame that the pyramids reach from the box: x0, y0, x1, y1."""
    margin = 0.5 * float(max(size_of(box))) + 24
    height, width = frame.shape[:2]
    x0, y0 = (max(0, int(value - margin)) for value in box[:2])
    x1, y1 = (min(limit, int(value + margin)) for value, limit in zip(box[2:], (width, height), strict=True))
    if min(x1 - x0, y1 - y0) < _WINDOW_PX:
        raise Unusable("the tracker left the image")
    return x0, y0, x1, y1


def _grid(box: Box) -> Points:
    """Return `_GRID`² points of the box, row by row (n, 2), in OpenCV's pixel-centre indices."""
    x1, y1, x2, y2 = box - 0.5
    inset_x, inset_y = _INSET * (x2 - x1), _INSET * (y2 - y1)
    columns = np.linspace(x1 + inset_x, x2 - inset_x, _GRID, dtype=np.float32)
    rows = np.linspace(y1 + inset_y, y2 - inset_y, _GRID, dtype=np.float32)
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def _flow(first: Image, second: Image, points: Points) -> tuple[Points, NDArray[np.bool_]]:
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        first,
        second,
        points[:, None],
        np.empty_like(points[:, None]),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=_LEVELS,
        criteria=_STOP,
        minEigThreshold=_MIN_EIGENVALUE,
    )
    return np.asarray(moved, dtype=np.float32)[:, 0], status.ravel() > 0


def _growth(starts: NDArray[np.float64], ends: NDArray[np.float64]) -> float:
    one, other = np.triu_indices(len(starts), 1)
    before = np.linalg.norm(starts[one] - starts[other], axis=1)
    after = np.linalg.norm(ends[one] - ends[other], axis=1)
    return float(np.median(after / before))


def _csrt() -> Any:  # OpenCV's trackers have no type in common
    """Make a CSRT tracker; raises `TrackerRefused`."""
    create = getattr(cv2, "TrackerCSRT_create", None)
    if create is None:
        raise TrackerRefused(
            "CSRT is not part of this OpenCV: uninstall opencv-python-headless and install "
            "opencv-contrib-python-headless, the extra 'trackers'."
        )
    return create()


@cache  # loading takes longer than following, and `init` starts anew
def _nano(backbone: str | Path | None, head: str | Path | None) -> Any:
    """Make a NanoTrack tracker; raises `TrackerRefused` without readable models."""
    if backbone is None or head is None:
        raise TrackerRefused("NanoTrack needs two model files (ONNX): give both the backbone and the head.")
    for path in (backbone, head):
        if not Path(path).is_file():
            raise TrackerRefused(f"The model file {path} does not exist.")
    opencv: Any = cv2  # whose stubs do not list its trackers
    parameters = opencv.TrackerNano_Params()
    parameters.backbone, parameters.neckhead = str(backbone), str(head)
    try:
        return opencv.TrackerNano_create(parameters)
    except cv2.error as fault:
        raise TrackerRefused(f"OpenCV cannot read the models {backbone} and {head}.") from fault


def _follow(tracker: Any, frames: list[Image], *, box: Box) -> Box:
    """Return the box in the last colour frame; OpenCV's trackers round to whole pixels."""
    x1, y1, x2, y2 = (round(float(value)) for value in box)
    tracked = (x1, y1, x2 - x1, y2 - y1)
    tracker.init(frames[0], tracked)
    for frame in frames[1:]:
        kept, tracked = tracker.update(frame)
        if not kept or min(tracked[2:]) <= 0:
            raise Unusable("the tracker lost the object")
    left, top, width, height = tracked
    return np.array([left, top, left + width, top + height], dtype=np.float64)
