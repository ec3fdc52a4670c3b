"""The exit codes. A script reads them, so their meaning never changes."""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class Exit(IntEnum):
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
    UNCONFIRMED = 10
    INTERRUPTED = 130
    CLOSED = 141


MEANINGS: Final[dict[Exit, str]] = {
    Exit.GOOD: "success",
    Exit.REJECTED: "the file is at fault: rejected, too large, malformed, or an invalid receipt",
    Exit.USAGE: "wrong usage: an unknown option or name, an unusable path, or no confirmation (--yes)",
    Exit.NETWORK: "network: no leaderboard at the address, or an incomplete answer",
    Exit.AUTH: "token: missing, not accepted, or without the necessary scope",
    Exit.QUOTA: "not now: the quota is used up, or too many requests in a short time",
    Exit.GATE: "gate: --fail-if or --fail-if-worse-than is true, or cannot be evaluated",
    Exit.SYSTEM: "the server failed; this is not your fault",
    Exit.REFUSED: "the server refused: not found, not open, cancelled",
    Exit.TIMEOUT: "not finished within --timeout; the evaluation continues",
    Exit.UNCONFIRMED: "not confirmed (--yes): the file has a warning, or a new method a name like another",
    Exit.INTERRUPTED: "interrupted with Ctrl-C",
    Exit.CLOSED: "the program that reads the output ended early, as head does",
}
"""Every code in words, as docs/cli.md has them."""
