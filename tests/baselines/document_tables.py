"""The rendered column of docs/baselines.md: `python -m tests.baselines.document_tables` prints it anew.

It renders 320 sequences, runs every method of the table on them and scores its file: a few minutes.
"""

import json
import re
import sys
import tempfile
from pathlib import Path

from click.testing import CliRunner

from evaluator import published
from evaluator.cli import main as tsttc
from tests.services import REPOSITORY

DOCUMENT = REPOSITORY / "docs" / "baselines.md"
ROW = re.compile(r"\| `(?P<method>[a-z-]+)(?P<options>[^`]*)`[^|]* \|[^|]*\|(?P<values>(?: [\d.]+ \|){5})")
COLUMNS = ("mid", "mid_crucial", "mid_small", "mid_large", "mid_negative")


def documented() -> dict[str, list[float]]:
    """The values of each command in the table of the document that are of rendered frames."""
    section = DOCUMENT.read_text(encoding="utf-8").partition("## What they score")[2].partition("\n## ")[0]
    return {
        match["method"] + match["options"]: [
            float(text) for text in match["values"].split(" |") if text.strip()
        ]
        for match in ROW.finditer(section)
    }


def rendered(folder: Path) -> Path:
    """The frames of the table, rendered into the folder."""
    frames = folder / "frames"
    _call("baseline", "render", str(frames), "--sequences", "320", "--seed", "7")
    return frames


def measured(command: str, *, frames: Path) -> list[float]:
    """MiD, overall and in each range, of one method on the rendered frames, with one decimal."""
    out = frames.with_name("out.json")
    out.unlink(missing_ok=True)
    method, *options = command.split()
    _call("baseline", "run", method, str(frames), "--out", str(out), *options)
    scores = json.loads(_call("score", str(out), "--truth", str(frames / "truth.csv"), "--json"))["scores"]
    flat = {"mid": scores["overall"]["mid"], **{f"mid_{name}": each["mid"] for name, each in scores.items()}}
    return [float(published(flat[name], decimals=1) or 0.0) for name in COLUMNS]


def _call(*words: str) -> str:
    result = CliRunner().invoke(tsttc, words)
    assert result.exit_code == 0, result.output
    return result.stdout


def main() -> None:
    """Print each row as it is in the document and as it is measured."""
    with tempfile.TemporaryDirectory() as folder:
        frames = rendered(Path(folder))
        for command, values in documented().items():
            found = measured(command, frames=frames)
            sys.stdout.write(f"{'same' if found == values else 'DIFFERS'}  {command}: {values} {found}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
