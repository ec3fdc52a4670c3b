"""The facts that the documentation page states, taken from the code that obeys them."""

from typing import Any, Final

from django.conf import settings

from evaluator.metrics.protocol import DEFAULT_PROTOCOL, get_protocol
from evaluator.problems import PROBLEM_CODES
from leaderboard.templatetags.board import size

# What only maintainers meet, when they import ground truth.
GROUND_TRUTH_CODES: Final = frozenset(
    {
        "unreadable",
        "bad-csv",
        "missing-columns",
        "bad-field",
        "empty",
        "duplicate-ids",
        "duplicate-natural-keys",
        "truth-not-finite",
        "truth-near-zero",
        "bad-digest",
        "forbidden-pickle",
        "bad-annotations",
    }
)


def docs() -> dict[str, Any]:
    """What `docs.html` needs."""
    protocol = get_protocol(DEFAULT_PROTOCOL)
    return {
        "protocol": protocol,
        "boundaries": [boundary.replace("-", "−") for boundary in protocol.boundaries],
        "max_size": size(settings.MAX_PREDICTIONS_BYTES),
        "problem_codes": [
            (code, meaning) for code, meaning in PROBLEM_CODES.items() if code not in GROUND_TRUTH_CODES
        ],
    }
