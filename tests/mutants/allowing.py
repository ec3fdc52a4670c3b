"""The list of faults that change nothing that anybody could notice."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.faults import Fault

LIST = Path(__file__).with_name("allowed.toml")


@dataclass(frozen=True)
class Allowed:
    """A fault that may live: every change of that text on that line."""

    file: str
    line: str
    change: str
    reason: str


def read(path: Path = LIST) -> list[Allowed]:
    """The list.

    Raises:
        TypeError: an entry has a missing or unknown key.
    """
    return [Allowed(**entry) for entry in tomllib.loads(path.read_text()).get("allowed", [])]


def reason_for(fault: Fault, allowed: list[Allowed], root: Path) -> str | None:
    """Why the fault may live, if it may."""
    text = (root / fault.path).read_text().splitlines()[fault.line - 1].strip()
    wanted = (fault.path, text, fault.change)
    return next((one.reason for one in allowed if (one.file, one.line, one.change) == wanted), None)
