"""The exit codes: whose turn it is. A script reads them, so they never change their meaning."""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class Exit(IntEnum):
    """How a command ended."""

    GOOD = 0
    REJECTED = 1
    USAGE = 2
    NETWORK = 3
    AUTH = 4
    QUOTA = 5
    GATE = 6
    SYSTEM = 7
    REFUSED = 8
    TIMEOUT = 9
    INTERRUPTED = 130


MEANINGS: Final[dict[Exit, str]] = {
    Exit.GOOD: "good",
    Exit.REJECTED: "the file is at fault: rejected, too large, malformed, or a receipt that does not hold",
    Exit.USAGE: "the command was called wrongly: an unknown option or name, a file that cannot be opened",
    Exit.NETWORK: "the network: no leaderboard answers at the address, or not to the end",
    Exit.AUTH: "the token: none, not accepted, or not good for this",
    Exit.QUOTA: "not now: the quota is spent, or there were too many requests in a short time",
    Exit.GATE: "a gate: --fail-if or --fail-if-worse-than holds, or cannot be judged",
    Exit.SYSTEM: "the server failed; the fault is not yours",
    Exit.REFUSED: "the server says no: no such thing, not open, cancelled",
    Exit.TIMEOUT: "not done within --timeout; it goes on by itself",
    Exit.INTERRUPTED: "interrupted with Ctrl-C",
}
"""Every code in words, as docs/cli.md has them."""
