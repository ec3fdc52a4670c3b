"""The facts on the documentation page, taken from the code."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, Final

from django.conf import settings
from django.utils.text import get_text_list

from evaluator.counting import file_size
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, PROTOCOLS, Protocol
from evaluator.metrics.registry import WARNING_S, Metric
from leaderboard.boards import listing
from leaderboard.models import Split
from leaderboard.quotas import admissions

# What the metrics of the paper and of its driving scenario say, as the end of a sentence.
_MEANINGS: Final = {
    "mid": "compares how much the object grows in the image from frame to frame at 10 Hz with the growth "
    "that the prediction implies; 0 is perfect",
    "rte": "|τ̂\N{NO-BREAK SPACE}−\N{NO-BREAK SPACE}τ|\N{NO-BREAK SPACE}/\N{NO-BREAK SPACE}|τ|, with the "
    "predicted time τ̂ and the true time τ",
    "warning": f"says whether the prediction misses a warning or gives a false one at {WARNING_S:g} s, the "
    "threshold of forward collision warning that the paper cites",
}


def _as_in_toolkit(protocol: Protocol) -> str:
    """Name the metrics that differ from those of the dataset's toolkit near 0 at most; empty without any."""
    toolkit = PROTOCOLS["toolkit"]
    if replace(protocol, name="toolkit", near_zero_s=None, metrics=toolkit.metrics) != toolkit:
        return ""
    return " and ".join(metric.symbol for metric in protocol.metrics if metric in toolkit.metrics)


def _metrics(protocol: Protocol, splits: Sequence[Split]) -> list[tuple[Metric, str]]:
    """Return the metrics of the protocol, then those that only other boards have, each with what it says."""
    boards: dict[Metric, list[str]] = {}
    for split in splits:
        if split.current_edition is not None:
            for metric in split.current_edition.rules.metrics:
                if metric not in protocol.metrics:
                    words = f"{split.title} (protocol {split.current_edition.protocol})"
                    boards.setdefault(metric, []).append(words)
    own = [(metric, metric_words(metric)) for metric in protocol.metrics]
    return own + [(metric, metric_words(metric, boards=names)) for metric, names in boards.items()]


def metric_words(metric: Metric, *, boards: Sequence[str] = ()) -> str:
    """Say behind a metric's name its unit, the only boards that have it, and its meaning."""
    unit = f", in {metric.unit}" if metric.unit else ""
    only = f", only on {' and '.join(boards)}" if boards else ""
    meaning = f": {_MEANINGS[metric.name]}" if metric.name in _MEANINGS else ""
    return f"{unit}{only}{meaning}"


def range_ends_words(protocol: Protocol) -> str:
    """Say which ends belong to the TTC ranges."""
    are_all_closed = all(len(each.closed_ends) == 2 for each in protocol.ranges)
    return ", both ends included" if are_all_closed else "; [ and ] include an end, ( and ) do not"


def shared_ends_words(protocol: Protocol) -> str:
    """Say which ends belong to two TTC ranges; empty without any."""
    ends = [end for each in protocol.ranges for end in each.closed_ends]
    shared = sorted({end for end in ends if end and ends.count(end) > 1})  # no truth is 0
    if not shared:
        return ""
    values = " or ".join(f"{end:g} s" for end in shared)
    as_in_toolkit = ", as in the dataset’s toolkit" if _as_in_toolkit(protocol) else ""
    return f"A sequence at exactly {values} counts in two TTC ranges{as_in_toolkit}."


def near_zero_words(protocol: Protocol) -> str:
    """Say when the scores are those of the dataset's toolkit; empty if they always or never are."""
    symbols = _as_in_toolkit(protocol)
    if protocol.near_zero_s is None or not symbols:
        return ""
    low, high = (f"{end:g}".replace("-", "−") for end in protocol.near_zero_s)
    return (
        f"If a file has no prediction between {low} and {high} s, its {symbols} are those of the "
        "dataset’s toolkit."
    )


def docs(splits: Sequence[Split], *, now: datetime) -> dict[str, Any]:
    # For the example commands: a split that takes submissions, else one with a manifest.
    is_open = (split for split in splits if admissions.is_open(split, now=now))
    example = next(is_open, None) or next((split for split in splits if split.has_ground_truth), None)
    # The board that is quoted; without it the first.
    main = next(
        (split for split in splits if split.pk == settings.BENCHMARK.default_split), next(iter(splits), None)
    )
    protocol = listing.rules_of(main.current_edition if main else None)
    metrics = _metrics(protocol, splits)
    boundaries = [f"{boundary.replace('-', '−')} s" for boundary in protocol.boundaries]
    return {
        "example": example.pk if example else "SPLIT",
        "has_manifest": example is not None,
        "is_open": example is not None and admissions.is_open(example, now=now),
        "protocol": protocol,
        # The commands name a protocol that is not the default.
        "other_protocol": "" if protocol.name == DEFAULT_PROTOCOL else protocol.name,
        "symbols": [metric.symbol for metric in protocol.metrics],
        "all_symbols": [metric.symbol for metric, _ in metrics],
        "metrics": metrics,
        "limit": f"{protocol.limit_s:g}",
        "ends_words": range_ends_words(protocol),
        "shared_ends": shared_ends_words(protocol),
        "boundaries": get_text_list(boundaries, "or"),
        "near_zero": near_zero_words(protocol),
        "max_size": file_size(settings.MAX_PREDICTIONS_BYTES),
    }
