"""TSTTC's evaluator: prediction files in, motion-in-depth error and relative time-to-contact error out.

    truth = read_truth("annotations/val")  # the folder that comes with the dataset, or a table
    predictions = read_predictions("mine.json", manifest=truth.manifest)
    print(evaluate(predictions, truth))

Files: `read_predictions`, `write_predictions`, `convert`, `read_truth`, `read_manifest`, `read_numbering`,
`manifest_frame`, `predictions_from_frame`, with `Predictions`, `GroundTruth`, `Manifest` and `Table`.
Scores: `evaluate`, which returns a `Report` of `RangeScore`s, `compare_predictions`, which returns
`Difference`s, `confidence_intervals`, `get_protocol`, `Protocol`, `PROTOCOLS`, `SCORE_NAMES`, `TTC_RANGES`,
`rounded`, `format_rounded`.
Scale ratios: `scale_ratio_to_ttc`, `ttc_to_scale_ratio`, `convert_rate`, `fps_of_gap`.
A leaderboard: `Client`, `ClientError`. Faults of a file: `Rejected`, `Problem`, `PROBLEM_CODES`.

It needs no network, clock or global state.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evaluator.client.answers import ClientError
    from evaluator.client.api import Client
    from evaluator.frames import manifest_frame, predictions_from_frame
    from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES, TTC_RANGES, Protocol, get_protocol
    from evaluator.metrics.scale import convert_rate, fps_of_gap, scale_ratio_to_ttc, ttc_to_scale_ratio
    from evaluator.predictions.conversion import convert
    from evaluator.predictions.loading import Predictions, read_predictions
    from evaluator.predictions.writing import write_predictions
    from evaluator.problems import PROBLEM_CODES, Problem, Rejected
    from evaluator.scoring.differences import compare_predictions
    from evaluator.scoring.intervals import confidence_intervals
    from evaluator.scoring.report import Report
    from evaluator.scoring.results import RangeScore, format_rounded, rounded
    from evaluator.scoring.scores import evaluate
    from evaluator.scoring.significance import Difference
    from evaluator.truth.csv_tables import Table
    from evaluator.truth.ground_truth import GroundTruth, Manifest, read_manifest, read_truth
    from evaluator.truth.numbering import read_numbering

    __version__: str
else:
    # Each name is imported when it is first asked for: `tsttc --help` then answers without loading numpy.
    _HOMES = {
        "client.answers": ("ClientError",),
        "client.api": ("Client",),
        "frames": ("manifest_frame", "predictions_from_frame"),
        "metrics.scale": ("convert_rate", "fps_of_gap", "scale_ratio_to_ttc", "ttc_to_scale_ratio"),
        "predictions.conversion": ("convert",),
        "truth.csv_tables": ("Table",),
        "truth.numbering": ("read_numbering",),
        "scoring.differences": ("compare_predictions",),
        "predictions.loading": ("Predictions", "read_predictions"),
        "problems": ("PROBLEM_CODES", "Problem", "Rejected"),
        "metrics.protocol": ("TTC_RANGES", "PROTOCOLS", "SCORE_NAMES", "Protocol", "get_protocol"),
        "scoring.report": ("Report",),
        "scoring.results": ("RangeScore", "format_rounded", "rounded"),
        "scoring.scores": ("evaluate",),
        "scoring.significance": ("Difference",),
        "truth.ground_truth": ("GroundTruth", "Manifest", "read_manifest", "read_truth"),
        "scoring.intervals": ("confidence_intervals",),
        "predictions.writing": ("write_predictions",),
    }
    _HOME_OF = {name: f"evaluator.{module}" for module, names in _HOMES.items() for name in names}

    def __getattr__(name: str) -> object:
        if name == "__version__":
            value: object = _version()
        elif name in _HOME_OF:
            value = getattr(import_module(_HOME_OF[name]), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        # What is loaded late would be missing, and what this module imports would be offered.
        return sorted(__all__)

    def _version() -> str:
        metadata = import_module("importlib.metadata")  # costs more time than the rest of --help
        try:
            return str(metadata.version("tsttc"))
        except metadata.PackageNotFoundError:
            return "0"


__all__ = [
    "PROBLEM_CODES",
    "PROTOCOLS",
    "SCORE_NAMES",
    "TTC_RANGES",
    "Client",
    "ClientError",
    "Difference",
    "GroundTruth",
    "Manifest",
    "Predictions",
    "Problem",
    "Protocol",
    "RangeScore",
    "Rejected",
    "Report",
    "Table",
    "__version__",
    "compare_predictions",
    "confidence_intervals",
    "convert",
    "convert_rate",
    "evaluate",
    "format_rounded",
    "fps_of_gap",
    "get_protocol",
    "manifest_frame",
    "predictions_from_frame",
    "read_manifest",
    "read_numbering",
    "read_predictions",
    "read_truth",
    "rounded",
    "scale_ratio_to_ttc",
    "ttc_to_scale_ratio",
    "write_predictions",
]
