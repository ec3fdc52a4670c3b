"""TSTTC's evaluator: prediction files in, motion-in-depth error and relative time-to-contact error out.

    truth = read_truth("annotations/val")  # the folder that comes with the dataset, or a table
    predictions = read_predictions(Path("mine.json").read_bytes(), manifest=truth.manifest)
    print(evaluate(predictions, truth).to_json())

Arithmetic about files: no network, no clock, no global state.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evaluator.differences import Difference, compare_predictions
    from evaluator.predictions import Predictions, read_predictions
    from evaluator.problems import PROBLEM_CODES, Problem, Rejected
    from evaluator.protocol import INTERVALS, PROTOCOLS, SCORE_NAMES, Protocol, get_protocol
    from evaluator.report import IntervalScore, Report, format_published, published
    from evaluator.scoring import evaluate, evaluate_many
    from evaluator.truth import GroundTruth, Manifest, read_manifest, read_truth
    from evaluator.uncertainty import confidence_intervals
    from evaluator.writing import write_predictions
else:
    # Each name is imported when it is first asked for: `tsttc --help` then answers without loading numpy.
    _HOMES = {
        "differences": ("Difference", "compare_predictions"),
        "predictions": ("Predictions", "read_predictions"),
        "problems": ("PROBLEM_CODES", "Problem", "Rejected"),
        "protocol": ("INTERVALS", "PROTOCOLS", "SCORE_NAMES", "Protocol", "get_protocol"),
        "report": ("IntervalScore", "Report", "format_published", "published"),
        "scoring": ("evaluate", "evaluate_many"),
        "truth": ("GroundTruth", "Manifest", "read_manifest", "read_truth"),
        "uncertainty": ("confidence_intervals",),
        "writing": ("write_predictions",),
    }
    _HOME_OF = {name: f"evaluator.{module}" for module, names in _HOMES.items() for name in names}

    def __getattr__(name: str) -> object:
        """A public name, from the module that defines it."""
        if name not in _HOME_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_HOME_OF[name]), name)
        return value


__all__ = [
    "INTERVALS",
    "PROBLEM_CODES",
    "PROTOCOLS",
    "SCORE_NAMES",
    "Difference",
    "GroundTruth",
    "IntervalScore",
    "Manifest",
    "Predictions",
    "Problem",
    "Protocol",
    "Rejected",
    "Report",
    "compare_predictions",
    "confidence_intervals",
    "evaluate",
    "evaluate_many",
    "format_published",
    "get_protocol",
    "published",
    "read_manifest",
    "read_predictions",
    "read_truth",
    "write_predictions",
]
