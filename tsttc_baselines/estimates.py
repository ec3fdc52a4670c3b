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

    `scale_ratio` is α > 0, the object's size in the reference frame over that in the target frame.
    `confidence` compares estimates of one baseline, without unit. `fallback` is why the value is not the
    baseline's own, such as "box has no texture", else None.
    """

    scale_ratio: float
    confidence: float = 1.0
    fallback: str | None = None


class Estimator(Protocol):
    """A baseline with its parameters.

    If a parameter is "auto", `used` holds the value actually chosen: a dict of parameters, which the
    prediction file then has.
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
    """A clip without an estimate; the message is the reason to count."""


class SequenceFault(Unusable):
    """A fault in one sequence's input: a short reason, and the problem in a sentence."""

    def __init__(self, reason: str, problem: Problem) -> None:
        super().__init__(reason)
        self.problem = problem
