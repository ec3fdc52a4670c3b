"""Small made-up ground truths, prediction files for them, and the dataset's toolkit as a plain loop."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from click.testing import Result

from evaluator import GroundTruth
from evaluator.truth.csv_tables import Table

REPOSITORY = Path(__file__).resolve().parents[2]
EXAMPLES = REPOSITORY / "examples"
GOLDEN = REPOSITORY / "tests" / "golden" / "toolkit.json"

# The command in this process, as the fixture of this name runs it.
Tsttc = Callable[..., Result]


def screen_text(terminal: int) -> str:
    """Read all that was written to a pseudo terminal whose other ends are closed, and close this end."""
    shown = b""
    with os.fdopen(terminal, "rb", buffering=0) as screen, suppress(OSError):  # raised at its end
        while piece := screen.read(1 << 16):
            shown += piece
    return shown.decode()


def process(*arguments: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Run the command as a process of its own; it inherits the recorded site's address from the test."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    command = [sys.executable, "-m", "evaluator", *map(str, arguments)]
    done: subprocess.CompletedProcess[str] = subprocess.run(
        command, text=True, check=False, cwd=REPOSITORY, **streams
    )
    return done


def on_terminal(
    *arguments: object, stream: str = "stderr", **environment: str
) -> "tuple[subprocess.CompletedProcess[str], str]":
    """Run the command with one of its streams on a terminal; give the text of the terminal too."""
    terminal, end = os.openpty()
    options: dict[str, Any] = {"stdin": subprocess.DEVNULL, stream: end}
    done = process(*arguments, **options, env=os.environ | {"TERM": "xterm"} | environment)
    os.close(end)
    return done, screen_text(terminal)


def make_truth(
    ttc_s: Iterable[float], *, anno_ids: Sequence[int] | None = None, bags: Sequence[str] | None = None
) -> GroundTruth:
    """A ground truth with these values: four sequences per recording, distinct natural keys."""
    values = [float(value) for value in ttc_s]
    n = len(values)
    return GroundTruth.from_table(
        Table(
            anno_id=list(anno_ids or range(n)),
            bag_stamp=list(bags or (f"{row // 4:04d}" for row in range(n))),
            cam_id=["1"] * n,
            ts_ns=[500_000_000 + 100_000_000 * row for row in range(n)],
            track_id=[str(row % 4) for row in range(n)],
            ttc_s=values,
        )
    )


def flat(values: Mapping[str, object] | Sequence[object]) -> bytes:
    """The toolkit's form; a sequence is keyed by 0, 1, …"""
    members = values if isinstance(values, Mapping) else {str(row): value for row, value in enumerate(values)}
    return json.dumps(members).encode()


def envelope(predictions: object, **fields: object) -> bytes:
    return json.dumps({**fields, "predictions": predictions}).encode()


def scale_ratio_of_the_toolkit(ttc_s: float) -> float:
    return 1 / ((1 / (ttc_s * 10) + 1) + 1e-6)


def errors_of_the_toolkit(predicted_s: float, true_s: float) -> dict[str, float]:
    """Both errors of one sequence, in the toolkit's order of operations."""
    clipped = max(min(predicted_s, 20), -20)
    predicted, true = scale_ratio_of_the_toolkit(clipped), scale_ratio_of_the_toolkit(true_s)
    return {
        "rte": abs((clipped - true_s) / true_s) * 100,
        "mid": abs(math.log(true) - math.log(predicted)) * 10**4,
    }


def means_of_the_toolkit(
    predicted_s: Sequence[float], true_s: Sequence[float]
) -> dict[str, dict[str, float | int | None]]:
    """Mean errors and counts by TTC range, sequence after sequence; None where a range is empty."""
    ranges = {"crucial": (0, 3), "small": (3, 6), "large": (6, 20), "negative": (-20, 0)}
    parts = {"overall": list(range(len(true_s)))}
    for name, (low, high) in ranges.items():
        parts[name] = [row for row, true in enumerate(true_s) if low <= true <= high]
    errors = [errors_of_the_toolkit(p, t) for p, t in zip(predicted_s, true_s, strict=True)]
    return {
        name: {
            metric: sum(errors[row][metric] for row in rows) / len(rows) if rows else None
            for metric in ("mid", "rte")
        }
        | {"count": len(rows)}
        for name, rows in parts.items()
    }
