"""Detection: the scale ratio as the ratio of two boxes' sizes, without images."""

# The paper (§6.1) takes the ratio of *areas* as α, which about halves every time to contact: its rows are a
# definition, and boxes can do better. The other measures are lengths.

from __future__ import annotations

import math
from dataclasses import dataclass

from tsttc_baselines.boxes import Measure, is_usable, scale_ratio_of_boxes
from tsttc_baselines.clips import TARGET, Box, Clip
from tsttc_baselines.estimates import Estimate, Unusable


@dataclass(frozen=True, slots=True)
class Detection:
    """The baseline: α is the size of the reference box over that of the target box."""

    measure: Measure = "area"

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α; raises `Unusable` for a missing or empty box."""
        reference, target = clip.boxes[TARGET - frame_gap], clip.boxes[TARGET]
        return Estimate(scale_ratio_of_two(reference, target, measure=self.measure))


def scale_ratio_of_two(reference: Box, target: Box, *, measure: Measure) -> float:
    """Divide the reference box's size by the target's; raises `Unusable` unless both have one."""
    if not (is_usable(reference) and is_usable(target)):
        raise Unusable("box has no size")
    ratio = float(scale_ratio_of_boxes(reference, target, measure=measure))
    if not 0 < ratio < math.inf:  # of sides near the smallest or largest number there is
        raise Unusable("box has no size")
    return ratio
