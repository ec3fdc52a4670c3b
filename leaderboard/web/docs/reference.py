"""The facts on the documentation page, taken from the code."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

from django.conf import settings

from evaluator.counting import file_size
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, PROTOCOLS, Protocol
from evaluator.metrics.registry import WARNING_S, Metric
from leaderboard.boards import listing
from leaderboard.models import Split
from leaderboard.quotas import admissions


def _as_in_toolkit(protocol: Protocol) -> str:
    """Name the metrics that differ from those of the dataset's toolkit near 0 at most; empty without any."""
    toolkit = PROTOCOLS["toolkit"]
    if replace(protocol, name="toolkit", near_zero_s=None, metrics=toolkit.metrics) != toolkit:
        return ""
    return " and ".join(metric.symbol for metric in protocol.metrics if metric in toolkit.metrics)


def _metrics(protocol: Protocol, splits: Sequence[Split]) -> list[tuple[Metric, str]]:
    """Return the metrics of the protocol, then those that only other boards have, with these boards."""
    boards: dict[Metric, list[str]] = {}
    for split in splits:
        if split.current_edition is not None:
            for metric in split.current_edition.rules.metrics:
                if metric not in protocol.metrics:
                    words = f"{split.title} (protocol {split.current_edition.protocol})"
                    boards.setdefault(metric, []).append(words)
    own = [(metric, "") for metric in protocol.metrics]
    return own + [(metric, " and ".join(names)) for metric, names in boards.items()]


def docs(splits: Sequence[Split], *, now: datetime) -> dict[str, Any]:
    # For the example commands: a split that takes submissions, else one with a manifest.
    is_open = (split for split in splits if admissions.is_open(split, now=now))
    example = next(is_open, None) or next((split for split in splits if split.has_ground_truth), None)
    # The board that is quoted; without it the first.
    main = next(
        (split for split in splits if split.pk == settings.BENCHMARK.default_split), next(iter(splits), None)
    )
    protocol = listing.rules_of(main.current_edition if main else None)
    ends = [end for each in protocol.ranges for end in each.closed_ends]
    shared = sorted({end for end in ends if end and ends.count(end) > 1})  # no truth is 0
    return {
        "example": example.pk if example else "SPLIT",
        "has_manifest": example is not None,
        "is_open": example is not None and admissions.is_open(example, now=now),
        "protocol": protocol,
        "default_protocol": DEFAULT_PROTOCOL,
        "metrics": _metrics(protocol, splits),
        "limit": f"{protocol.limit_s:g}",
        "has_open_ends": len(ends) < 2 * len(protocol.ranges),
        "shared_ends": [f"{end:g} s" for end in shared],
        "follows_toolkit": _as_in_toolkit(protocol),
        "warning_s": f"{WARNING_S:g}",
        "boundaries": [boundary.replace("-", "−") for boundary in protocol.boundaries],
        "max_size": file_size(settings.MAX_PREDICTIONS_BYTES),
    }
