"""The rules for a value of a prediction file, one list for reading, writing, conversion and scoring.

To add a rule, add it to `RULES` and its code to `PROBLEM_CODES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.predictions.documents import Unit, kind_of
from evaluator.predictions.slips import WITHOUT_ESTIMATE


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule: `holds` for a number or elementwise for an array; {} in its texts is the value.

    `advice` is a sentence of what to write instead.
    """

    code: str
    holds: Callable[[Any], Any]
    expected: str
    shown: str = "{}"
    advice: str = ""

    def message(self, value: float) -> str:
        sentence = f"The value is {self.shown.format(kind_of(value))}; expected {self.expected}."
        return f"{sentence} {self.advice}".rstrip()


_RATIO: Final = "a scale ratio greater than 0"

RULES: Final[dict[Unit, tuple[Rule, ...]]] = {
    "ttc": (
        # NaN alone differs from itself.
        Rule(
            "nan",
            lambda value: value == value,  # noqa: PLR0124 -- as above
            "a number of seconds",
            "NaN",
            WITHOUT_ESTIMATE,
        ),
        Rule(
            "zero", lambda value: value != 0, "a time to contact other than 0, negative when moving away", "0"
        ),
    ),
    "scale_ratio": (
        Rule("nan", lambda value: value == value, _RATIO, "NaN", WITHOUT_ESTIMATE),  # noqa: PLR0124 -- as above
        Rule("not-positive", lambda value: value > 0, _RATIO),
    ),
}
"""The rules by unit, in the order in which they are asked; scale ratios are asked again as seconds."""


def broken_rule(value: float, *, unit: Unit) -> Rule | None:
    return next((rule for rule in RULES[unit] if not rule.holds(value)), None)


def allowed(values: Floats, *, unit: Unit) -> NDArray[np.bool_]:
    is_allowed = np.ones(values.shape, dtype=np.bool_)
    for rule in RULES[unit]:
        is_allowed &= rule.holds(values)
    return is_allowed
