"""The facts that the documentation page states, taken from the code that obeys them."""

from typing import Any

from django.conf import settings

from evaluator.problems import PROBLEM_CODES
from evaluator.protocol import DEFAULT_PROTOCOL, get_protocol
from leaderboard.templatetags.board import size
from leaderboard.web.tables import interval_facts


def docs() -> dict[str, Any]:
    """What `docs.html` needs."""
    protocol = get_protocol(DEFAULT_PROTOCOL)
    return {
        "protocol": protocol,
        "boundaries": [boundary.replace("-", "−") for boundary in protocol.boundaries],
        "intervals": interval_facts({}),
        "max_size": size(settings.MAX_PREDICTIONS_BYTES),
        "problem_codes": PROBLEM_CODES.items(),
    }
