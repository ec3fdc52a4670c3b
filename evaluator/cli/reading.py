"""Reading the files that a command names, with every fault of them in the library's words."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, rejected
from evaluator.problems import Rejected

if TYPE_CHECKING:
    from evaluator import GroundTruth
    from evaluator.units import Units

TABLE: Final = click.Path(exists=True, path_type=Path)
FOLDER: Final = click.Path(exists=True, file_okay=False, path_type=Path)


OTHER_MANIFEST: Final = (
    "If the file was made for another split or edition, check it with that manifest: tsttc manifest "
    "--split SPLIT --edition N -o other.csv"
)
"""Offline, nobody can tell which one: the names of all splits and editions are on the leaderboard."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn the library's rejection into a failure that names the file."""
    try:
        yield
    except Rejected as fault:
        raise rejected(name_of(path), fault) from None


@contextmanager
def naming_predictions(path: Path) -> Iterator[None]:
    """Do the same for predictions read with a manifest; if only keys are wrong, say which one may fit."""
    try:
        yield
    except Rejected as fault:
        codes = {problem.code for problem in fault.problems}
        has_other_keys = "unknown-keys" in codes and codes <= {"unknown-keys", "missing-keys"}
        raise rejected(name_of(path), fault, hint=OTHER_MANIFEST if has_other_keys else "") from None


def units_asked(truth: GroundTruth, unit: str | None) -> Units:
    try:
        return truth.manifest.units_by(unit)
    except ValueError as fault:
        raise click.BadParameter(str(fault), param_hint="--unit") from None


def name_of(path: Path) -> str:
    return "standard input" if str(path) == "-" else str(path)


def labels_of(paths: Sequence[Path]) -> list[str]:
    """What a table calls these files: their names, or their paths where two have the same name."""
    names = [path.name for path in paths]
    return [
        path.name if names.count(path.name) == 1 and path.name != "-" else name_of(path) for path in paths
    ]


def bytes_of(path: Path) -> bytes:
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        return path.read_bytes()
    except OSError as error:
        raise click.BadParameter(f"{path} cannot be read: {error.strerror}.") from None


def predictions_of(path: Path) -> bytes:
    """Read a prediction file or standard input; a Parquet table becomes JSON."""
    from evaluator.predictions import parquet  # noqa: PLC0415 -- few files need it

    with naming(path):
        try:
            return parquet.as_sent(bytes_of(path))
        except ModuleNotFoundError:
            raise Failure(
                f"Reading {name_of(path)}, a Parquet table, needs pyarrow, which is not installed.",
                exit_code=Exit.USAGE,
                code="not-installed",
                hint="Install it with: pip install pyarrow",
            ) from None


def write_bytes(path: Path, data: bytes, *, option: str = "-o") -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise click.BadParameter(f"{path} cannot be written: {error.strerror}.", param_hint=option) from None
