"""The interface of a baseline: a function of a clip that estimates one scale ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from evaluator.problems import Problem

if TYPE_CHECKING:
    from tsttc_baselines.clips import Clip


@dataclass(frozen=True, slots=True)
class Estimate:
    """The estimate of one sequence.

    - `scale_ratio`: α, the size of the object in the reference frame divided by its size in the target frame;
      above 0.
    - `confidence`: any number that is higher for better estimates of the same baseline.
    - `fallback`: None, or the reason why this is not the baseline's own value, such as "box has no texture".
    """

    scale_ratio: float
    confidence: float = 1.0
    fallback: str | None = None


class Estimator(Protocol):
    """A baseline with its parameters, called as `estimator(clip, frame_gap=5)`; returns an `Estimate`.

    `frame_gap` is 1 to 5: the estimate is the scale ratio between frame `5 - frame_gap` and frame 5. For an
    unusable clip, raise `Unusable`.

    If a parameter may be "auto", the object needs an attribute `used`: a dict with the values that it chose.
    The prediction file states them.
    """

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α between frame `5 - frame_gap` (1…5) and frame 5; raises `Unusable`."""
        # The runner replaces an unusable clip's value by the fallback.
        ...


PROBLEM_CODES: Final[dict[str, str]] = {
    "bad-box": "A box is missing, empty, reversed, too small, outside of its image or in another unit.",
    "bad-frame": "An image is missing, not readable or of another size, or a sequence has too few frames.",
    "bad-weights": "A file of weights is damaged, too large, or of another network.",
    "no-estimate": "A method has no estimate for a sequence.",
    "reversed-time": "The rows of a track are not in the order of time.",
}
"""What can be wrong with frames, boxes and tracks, beside the codes of `evaluator.problems` for tables."""


class Unusable(Exception):
    """Raise this if a clip has no estimate. The message is the reason, which the run counts."""


class SequenceFault(Unusable):
    """A fault in one sequence's input: a short reason, and the problem in a sentence."""

    def __init__(self, reason: str, problem: Problem) -> None:
        super().__init__(reason)
        self.problem = problem
