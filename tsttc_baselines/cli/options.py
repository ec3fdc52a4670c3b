"""Options that several subcommands share."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import click

from evaluator.cli.options import default_option
from evaluator.cli.reading import TABLE

TRUTH: Final = "truth.csv"
"""The ground truth of a folder, as `tsttc baseline render` writes it."""

Command = TypeVar("Command", bound=Callable[..., Any])


def gap_option(command: Command) -> Command:
    return default_option(
        "--gap",
        "frame_gap",
        type=click.IntRange(1, 5),
        default=5,
        help="Frames between reference and target.",
    )(command)


def keys_option(command: Command) -> Command:
    return default_option(
        "--keys",
        type=click.Choice(["natural", "anno-id"]),
        default="natural",
        help="Keys of the file: natural keys, valid in every edition, or anno_ids for the toolkit.",
    )(command)


def jobs_option(command: Command) -> Command:
    return click.option(
        "--jobs",
        "n_processes",
        type=click.IntRange(1, 1024),
        default=n_cores,
        help="Processes. [default: one for each CPU core]",
    )(command)


def out_option(what: str, *, name: str = "--out", metavar: str = "FILE") -> Callable[[Command], Command]:
    kind = click.Path(dir_okay=False, path_type=Path)
    return click.option("-o", name, required=True, type=kind, metavar=metavar, help=what)


def truth_option(what: str) -> Callable[[Command], Command]:
    return click.option("--truth", "truth_path", type=TABLE, metavar="FILE", help=what)


def require_writable(out: Path) -> None:
    # Before the work, not after it.
    if not os.access(out.parent, os.W_OK):
        raise click.BadParameter(f"{out.parent} is not a folder that can be written to.", param_hint="--out")


def n_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
