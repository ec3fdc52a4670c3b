"""`tsttc baseline simulate` and `render`: sequences with known truth, without and with images."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.options import default_option, json_option
from tsttc_baselines.cli import require_opencv
from tsttc_baselines.cli.options import jobs_option

if TYPE_CHECKING:
    from tsttc_baselines.simulation import Split

Command = Callable[..., Any]

_SOURCES = ("val", "test", "scripts")


def _split_options(command: Command) -> Command:
    options = (
        default_option(
            "--like",
            type=click.Choice(_SOURCES),
            default="val",
            help="Shares of the TTC ranges as in this split, or the runs of the six scripts.",
        ),
        default_option(
            "--sequences",
            "n_sequences",
            type=click.IntRange(1, 1_000_000),
            default=320,
            help="Number of sequences; scripts have their own.",
        ),
        click.option(
            "--recordings",
            "n_recordings",
            type=click.IntRange(1, 100_000),
            default=None,
            help="Number of recordings. [default: one for 40 sequences]",
        ),
        default_option("--seed", type=click.IntRange(0, 2**32 - 1), default=0),
        click.option(
            "--half-open", is_flag=True, help="scripts: (a, b, s) leaves out b, as Python's range does."
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def _draw(*, like: str, n_sequences: int, n_recordings: int | None, seed: int, half_open: bool) -> Split:
    import numpy as np  # noqa: PLC0415 -- --help can do without

    from tsttc_baselines import simulation  # noqa: PLC0415 -- as above

    rng = np.random.default_rng(seed)
    if like == "scripts":
        return simulation.scripted_split(rng=rng, closed=not half_open)
    if half_open:
        raise click.UsageError(f"--half-open is an option of --like scripts; found --like {like}.")
    return simulation.split(
        rng=rng,
        n_sequences=n_sequences,
        n_recordings=n_recordings or max(1, n_sequences // 40),
        shape=simulation.SHAPES[like],
    )


@click.command(short_help="Draw sequences with known truth, without images.")
@click.argument("out", type=click.Path(dir_okay=False, path_type=Path), metavar="TRUTH.csv")
@_split_options
@click.option(
    "--tracks",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also write each frame's distance and lateral distance in metres, and ego's speed.",
)
@json_option
def simulate(*, out: Path, tracks: Path | None, as_json: bool, **options: Any) -> None:
    """Draw a split of simulated driving and write its ground truth.

    Vehicles of the paper's six driving scripts and of highway driving; the same options give the same split.
    `tsttc baseline render` with these options makes its images.

    \b
    Examples:
      tsttc baseline simulate truth.csv --sequences 2000 --seed 7
      tsttc baseline simulate scripts.csv --like scripts --tracks tracks.csv
    """
    from evaluator.truth.csv_tables import COLUMNS  # noqa: PLC0415 -- --help can do without

    split = _draw(**options)
    try:
        out.write_text(split.table.text(COLUMNS))
        if tracks is not None:
            tracks.write_text(_track_table(split))
    except OSError as error:
        raise click.BadParameter(f"{error.filename} cannot be written: {error.strerror}.") from None
    _report(split, n_written=split.n_sequences, out=out, as_json=as_json)


def _track_table(split: Split) -> str:
    lines = ["anno_id,frame,gap_m,lateral_m,ego_mps"]
    for row in range(split.n_sequences):
        ego_mps = float(split.ego_mps[row])
        for frame, (gap_m, lateral_m) in enumerate(
            zip(split.gap_m[row].tolist(), split.lateral_m[row].tolist(), strict=True)
        ):
            lines.append(f"{row},{frame},{gap_m:.4f},{lateral_m:.4f},{ego_mps:.4f}")
    return "\n".join([*lines, ""])


@click.command(short_help="Render simulated sequences into a folder.")
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@_split_options
@default_option("--first", type=click.IntRange(0), default=0, help="The first anno_id rendered.")
@click.option("--count", type=click.IntRange(1), default=None, help="How many are rendered. [default: all]")
@jobs_option
@json_option
def render(
    *, folder: Path, first: int, count: int | None, n_processes: int, as_json: bool, **options: Any
) -> None:
    """Render sequences with known truth into FOLDER, which `tsttc baseline run` takes.

    FOLDER is new or empty; it gets manifest.csv, boxes.csv, truth.csv and images/. If a rendering is
    interrupted, the same command continues it. The images show the surroundings of one vehicle each. Each
    sequence follows from the seed and its anno_id, so --first and --count render any part of a split as it is
    in the whole.

    \b
    Examples:
      tsttc baseline render frames/ --sequences 12 --seed 7
      tsttc baseline render part/ --like test --sequences 28600 --seed 1 --first 500 --count 20
    """
    require_opencv()
    from tsttc_baselines.cli.progress import shown_progress  # noqa: PLC0415 -- OpenCV, which --help can do without
    from tsttc_baselines.processes import WorkerEnded  # noqa: PLC0415 -- as above
    from tsttc_baselines.rendering.folders import PART, OtherRendering, write_folder  # noqa: PLC0415 -- as above

    if not (folder / PART).is_file():
        _require_empty(folder)
    split = _draw(**options)
    if first >= split.n_sequences:
        message = f"{first}; expected an anno_id of the split, 0 to {split.n_sequences - 1}."
        raise click.BadParameter(message, param_hint="--first")
    rows = range(first, min(split.n_sequences, first + (count or split.n_sequences)))
    try:
        with shown_progress("Rendering", total=len(rows)) as progress:
            write_folder(
                split,
                seed=options["seed"],
                path=folder,
                rows=rows,
                n_processes=n_processes,
                progress=progress,
            )
    except OtherRendering:
        message = f"{folder} has an interrupted rendering of other options; expected these, or a new folder."
        raise click.BadParameter(message, param_hint="FOLDER") from None
    except WorkerEnded:
        message = (
            "A process of the run ended, probably because memory ran out; "
            "the same command with fewer --jobs continues the rendering."
        )
        raise Failure(message, exit_code=Exit.REJECTED, code="worker-ended") from None
    except OSError as error:
        message = f"{error.filename or folder} cannot be written: {error.strerror}."
        raise click.BadParameter(message, param_hint="FOLDER") from None
    _report(split, n_written=len(rows), out=folder, as_json=as_json)


def _require_empty(folder: Path) -> None:
    try:
        entries = folder.iterdir() if folder.exists() else iter(())
        entry = next((each for each in entries if each.name != ".DS_Store"), None)
    except OSError as error:
        message = f"{folder} cannot be read: {error.strerror}."
        raise click.BadParameter(message, param_hint="FOLDER") from None
    if entry is not None:
        message = f"{folder} has {entry.name} in it; expected a new or empty folder."
        raise click.BadParameter(message, param_hint="FOLDER")


def _report(split: Split, *, n_written: int, out: Path, as_json: bool) -> None:
    if as_json:
        echo_json({"output": str(out), "n_sequences": n_written, "truth_digest": split.truth.digest})
    else:
        click.echo(f"{out}: {n_written:,} of {split.n_sequences:,} sequences.")
