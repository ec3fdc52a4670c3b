"""Detection: the scale ratio as the ratio of two boxes' sizes; no image is looked at.

The paper (§6.1) takes the ratio of the *areas* as α, without a root, which about halves every time to
contact: its published rows are a definition, not the best that boxes can do. The other measures are lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tsttc_baselines.boxes import Measure, is_usable, scale_ratio_of_boxes
from tsttc_baselines.clips import TARGET, Box, Clip
from tsttc_baselines.estimates import Estimate, Unusable


@dataclass(frozen=True, slots=True)
class Detection:
    """α is the size of the reference box over that of the target box."""

    measure: Measure = "area"

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Raises `Unusable` where a box is missing or empty."""
        reference, target = clip.boxes[TARGET - frame_gap], clip.boxes[TARGET]
        return Estimate(scale_ratio_of_two(reference, target, measure=self.measure))


def scale_ratio_of_two(reference: Box, target: Box, *, measure: Measure) -> float:
    """The size of the reference box over that of the target box; raises `Unusable` unless both have one."""
    if not (is_usable(reference) and is_usable(target)):
        raise Unusable("box has no size")
    ratio = float(scale_ratio_of_boxes(reference, target, measure=measure))
    if not 0 < ratio < math.inf:  # of sides near the smallest or largest number there is
        raise Unusable("box has no size")
    return ratio
