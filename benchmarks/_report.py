"""The report of a run: `benchmarks/report.md`, and the figures of it that stand in the documentation.

A figure is a line `name = value unit` that a benchmark prints. In a document a table with the head
`| … | figure | measured |` has the names of figures in one column and their values in the next, which `renew`
writes.
"""

import os
import platform
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
REPORT: Final = FOLDER / "report.md"
DOCS: Final = FOLDER.parent / "docs"
NOT_MEASURED: Final = "not measured"
_LINE = re.compile(r"([a-z][\w.-]*) = (.+)")
_HEAD = re.compile(r"\| figure \| (?:measured|value) \|")
_ROW = re.compile(r"\| `([a-z][\w.-]*)` \| ([^|\n]+) \|")


@dataclass
class Measured:
    """What one benchmark printed: its figures, and what else it had to say."""

    name: str
    began_at: datetime
    load_before: float
    took_s: float = 0.0
    figures: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def hear(self, line: str) -> None:
        """Take in a line of it."""
        found = _LINE.fullmatch(line)
        if found:
            self.figures[found[1]] = found[2].replace("|", "/")
        elif line.strip():
            self.notes.append(line.strip())

    def text(self) -> str:
        """Its part of the report."""
        when = f"{self.began_at:%Y-%m-%d %H:%M} UTC, {self.took_s:.0f} s, load before {self.load_before:.1f}"
        rows = [f"| `{name}` | {value} |" for name, value in self.figures.items()]
        table = ["| figure | value |", "|---|---|", *rows, ""] if rows else []
        return (
            "\n".join([f"## {self.name}", "", f"{when}.", "", *(f"- {note}" for note in self.notes)]).rstrip(
                "\n"
            )
            + "\n\n"
            + "\n".join(table)
        )


def text(parts: Iterable[str]) -> str:
    """The whole report."""
    rows = "\n".join(f"| {what} | {value} |" for what, value in machine().items())
    head = (
        "# Benchmarks\n\nWritten by `make bench`; not by hand. Documents take their figures from here.\n\n"
        f"| | |\n|---|---|\n{rows}\n\n"
    )
    return head + "\n".join(part.rstrip("\n") + "\n" for part in parts).rstrip("\n") + "\n"


def machine() -> dict[str, str]:
    """What was measured, and on what."""
    return {
        "commit": _said("git", "describe", "--always", "--dirty", "--abbrev=12"),
        "processors": f"{os.cpu_count()} × {_field('/proc/cpuinfo', 'model name')}",
        "memory": f"{int(_field('/proc/meminfo', 'MemTotal').split()[0] or 0) / 1e6:.0f} GB",
        "system": f"{platform.system()} {platform.release()}",
        "Python": platform.python_version(),
    }


def _said(*command: str) -> str:
    done = subprocess.run(command, cwd=FOLDER, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


def _field(path: str, name: str) -> str:
    """The value of the first line of that name in one of the kernel's tables."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        lines = []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), "0 unknown")


def figures_in(text: str) -> dict[str, str]:
    """The figures of a report, or those that a document quotes, by name."""
    rows = (_ROW.search(line) for line, is_of_figures in _lines(text) if is_of_figures)
    return {row[1]: row[2].strip() for row in rows if row}


def renewed(document: str, figures: Mapping[str, str]) -> str:
    """The document with the value of each figure that it names; one that is unknown is said to be so."""

    def row(found: re.Match[str]) -> str:
        return f"| `{found[1]}` | {figures.get(found[1], NOT_MEASURED)} |"

    return "".join(_ROW.sub(row, line) if is_of_figures else line for line, is_of_figures in _lines(document))


def _lines(text: str) -> Iterator[tuple[str, bool]]:
    """Each line, and whether it is in a table of figures, as its head says."""
    is_of_figures = False
    for line in text.splitlines(keepends=True):
        is_of_figures = line.startswith("|") and (is_of_figures or _HEAD.search(line) is not None)
        yield line, is_of_figures


def documents() -> list[Path]:
    """Those that quote figures."""
    return [path for path in sorted(DOCS.rglob("*.md")) if "make bench" in path.read_text()]


def renew() -> None:
    """Write the figures of the report into the documents that quote them."""
    figures = figures_in(REPORT.read_text())
    for path in documents():
        path.write_text(renewed(path.read_text(), figures))
