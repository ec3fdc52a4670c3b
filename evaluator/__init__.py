"""TSTTC's evaluator: prediction files in, motion-in-depth error and relative time-to-contact error out.

    truth = read_truth("val.csv")
    predictions = read_predictions(Path("mine.json").read_bytes(), manifest=truth.manifest)
    print(evaluate(predictions, truth).to_json())

Arithmetic about files: no network, no clock, no global state.
"""

from evaluator.predictions import Predictions, read_predictions
from evaluator.problems import PROBLEM_CODES, Problem, Rejected
from evaluator.protocol import INTERVALS, PROTOCOLS, SCORE_NAMES, Protocol, get_protocol
from evaluator.report import IntervalScore, Report, format_published, published
from evaluator.scoring import evaluate, evaluate_many
from evaluator.truth import GroundTruth, Manifest, read_manifest, read_truth
from evaluator.writing import write_predictions

__all__ = [
    "INTERVALS",
    "PROBLEM_CODES",
    "PROTOCOLS",
    "SCORE_NAMES",
    "GroundTruth",
    "IntervalScore",
    "Manifest",
    "Predictions",
    "Problem",
    "Protocol",
    "Rejected",
    "Report",
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
