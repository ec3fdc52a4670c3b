"""One sequence, one value: the baseline's estimate, else the root of the boxes' areas, else 1."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from evaluator.problems import Problem
from tsttc_baselines.clips import TARGET
from tsttc_baselines.detection import scale_ratio_of_two
from tsttc_baselines.estimates import Estimate, Estimator, SequenceFault, Unusable
from tsttc_baselines.folders import SequenceFolder
from tsttc_baselines.images import ImageCache
from tsttc_baselines.methods import Method, Value
from tsttc_baselines.own_methods import line_of
from tsttc_baselines.sequence_checks import box_frames, require_boxes, require_sizes

NO_SCALE_CHANGE: Final = 1.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """The value of a row; for a fallback `problem` says why, `reason` in a few words."""

    row: int
    scale_ratio: float
    reason: str | None = None
    problem: Problem | None = None


class SequenceEstimator:
    """A method with its parameters on a folder, with a cache of images."""

    def __init__(
        self, *, folder: SequenceFolder, method: Method, parameters: Mapping[str, Value], frame_gap: int
    ) -> None:
        self.folder = folder
        self.method = method
        self.frame_gap = frame_gap
        self._estimator: Estimator = method.estimator(parameters)
        self._cache = ImageCache()

    def __call__(self, row: int) -> Outcome:
        """Estimate one row, by a fallback if necessary."""
        try:
            estimate = self._estimate(row)
            value = float(estimate.scale_ratio)
        except SequenceFault as fault:
            return self._fallback(row, str(fault), fault.problem)
        except Unusable as fault:
            return self._fallback(row, str(fault), self._problem(row, f"{fault}; expected an estimate"))
        except Exception as error:  # noqa: BLE001 -- one sequence must not end a run of hours; it is counted
            reason = f"the method failed with {type(error).__name__}"
            cause = f"{error}{line_of(error, self.method.factory)}"
            return self._fallback(
                row, reason, self._problem(row, f"{reason} ({cause}); expected an estimate")
            )
        if not 0 < value < math.inf:
            problem = self._problem(row, f"the estimate is {value}; expected a finite number greater than 0")
            return self._fallback(row, "estimate is not a positive number", problem)
        if estimate.fallback is None:
            return Outcome(row, value)
        problem = self._problem(row, f"{estimate.fallback}; expected an estimate of the method itself")
        return Outcome(row, value, estimate.fallback, problem)

    def _estimate(self, row: int) -> Estimate:
        frames = box_frames(self.method, self.frame_gap)
        require_boxes(self.folder, row, frames)
        with_images = self.method.frames != "none"
        clip = self.folder.clip(row, cache=self._cache, with_images=with_images)
        image_px = self.folder.size(row, cache=self._cache) if with_images else None
        require_sizes(self.folder, clip, row, frames, image_px=image_px)
        estimate: object = self._estimator(clip, frame_gap=self.frame_gap)
        if not isinstance(estimate, Estimate):  # as a method of another package may do
            raise TypeError(f"it returned a {type(estimate).__name__}, not an Estimate")
        return estimate

    def _fallback(self, row: int, reason: str, problem: Problem) -> Outcome:
        boxes = self.folder.boxes[row]
        try:
            value = scale_ratio_of_two(boxes[TARGET - self.frame_gap], boxes[TARGET], measure="sqrt-area")
        except Unusable:
            value = NO_SCALE_CHANGE
        return Outcome(row, value, reason, problem)

    def _problem(self, row: int, message: str) -> Problem:
        where = f"sequence {self.folder.manifest.anno_id[row]}"
        return Problem("no-estimate", f"{message[0].upper()}{message[1:]}.", where)
