"""`tsttc baseline train`: weights of Deep Scale, from a folder with ground truth or from rendered frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.options import default_option, json_option
from evaluator.cli.reading import FOLDER, naming
from evaluator.counting import counted
from tsttc_baselines.cli import require_opencv
from tsttc_baselines.cli.options import out_option, require_writable

if TYPE_CHECKING:
    from tsttc_baselines.deep_scale.training import Epoch, Recipe
    from tsttc_baselines.deep_scale.weights import Use, Weights
    from tsttc_baselines.pairs import Source

# Not that of the sequences on which documents compare the methods (7).
_VALIDATION_SEED = 13
_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
# The options that say how weights are used, each with words for its value.
_USE = {
    "similarity": ("--similarity", "the similarity {}"),
    "n_cells": ("--cells", "{} cells"),
    "max_box_px": ("--box", "boxes of {:g} pixels"),
    "margin_px": ("--margin", "a margin of {:g} pixels"),
}


def _or_of_start(default: str) -> str:
    return f"{default}, or that of --start"


@click.command(short_help="Train Deep Scale, on a folder or on rendered frames.")
@click.argument("folder", type=FOLDER, required=False)
@out_option("Write the weights of the best epoch to this file.")
@click.option("--val", "val_folder", type=FOLDER, help="Score each epoch on this folder. [default: rendered]")
@default_option(
    "--sequences",
    "n_sequences",
    type=click.IntRange(40, 1_000_000),
    default=6000,
    help="Without FOLDER: rendered sequences to learn from.",
)
@default_option(
    "--val-sequences",
    "n_val",
    type=click.IntRange(40, 100_000),
    default=320,
    help="Without --val: rendered sequences to score each epoch on.",
)
@default_option("--epochs", type=click.IntRange(1, 10_000), default=36)
@default_option("--batch", type=click.IntRange(1, 4096), default=16, help="Pairs of a step.")
@default_option(
    "--rate",
    "lr_per_pair",
    type=click.FloatRange(0, 1, min_open=True),
    default=1e-4,
    help="Greatest learning rate, for each pair of a step.",
)
@default_option("--optimizer", type=click.Choice(["sgd", "adam"]), default="sgd")
@default_option(
    "--ratio-weight",
    type=click.FloatRange(0, 1e6),
    default=0.0,
    help="Weight of |ln α̂ − ln α| in the loss.",
)
@default_option(
    "--fit-weight",
    type=click.FloatRange(0, 1e6),
    show_default="0; 1 if --start is decoded by the fit",
    help="Weight of the error of the fit, in MiD, in the loss.",
)
@default_option("--similarity", type=click.Choice(["cosine", "dot"]), show_default=_or_of_start("cosine"))
@default_option(
    "--cells",
    "n_cells",
    type=click.IntRange(5, 100),
    show_default=_or_of_start("50"),
    help="Cells of the target's box in each direction.",
)
@default_option(
    "--box",
    "max_box_px",
    type=click.FloatRange(16, 400),
    show_default=_or_of_start("120"),
    help="Larger boxes are shrunk to this size in pixels.",
)
@default_option(
    "--margin",
    "margin_px",
    type=click.FloatRange(0, 64),
    show_default=_or_of_start("16"),
    help="Pixels around what is compared.",
)
@click.option(
    "--log",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the figures of each epoch to this CSV file.",
)
@click.option("--start", type=_FILE, help="Begin with the weights of this file, used as they were.")
@default_option("--seed", type=click.IntRange(0, 2**32 - 1), default=0)
@default_option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu")
@json_option
def train(
    *,
    folder: Path | None,
    out: Path,
    val_folder: Path | None,
    n_sequences: int,
    n_val: int,
    start: Path | None,
    log: Path | None,
    device: str,
    as_json: bool,
    **recipe: Any,
) -> None:
    """Train the network of Deep Scale on FOLDER, or without it on rendered frames.

    A folder has frames and boxes as for `tsttc baseline run`, and truth.csv. After each epoch, the network is
    scored on sequences that it does not learn from. The defaults are the paper's recipe. Weights of --start
    are used as they were trained, and scored before epoch 1 too. If a training is interrupted, the same
    command continues it after its last whole epoch.

    \b
    Examples:
      tsttc baseline train tsttc/train/ --val tsttc/val/ --out weights.npz --device cuda
      tsttc baseline train --out weights.npz --sequences 2000 --optimizer adam
      tsttc baseline train tsttc/train/ --val tsttc/val/ --out mine.npz --start Deep_TTC.pth --rate 1e-5
    """
    require_writable(out)
    require_opencv()
    weights = _start(start) if start else None
    wanted = _use(recipe, start=weights)
    if find_spec("torch") is None:
        message = "Training needs torch; install it with: pip install torch"
        raise Failure(message, exit_code=Exit.USAGE, code="no-torch")
    from tsttc_baselines.cli.progress import shown_progress  # noqa: PLC0415 -- OpenCV and torch, as above
    from tsttc_baselines.deep_scale import training  # noqa: PLC0415 -- as above

    source = _folder_source(folder) if folder else _rendered(n_sequences, seed=1000 + recipe["seed"])
    validation = _folder_source(val_folder) if val_folder else _rendered(n_val, seed=_VALIDATION_SEED)
    total = source.truth.n_sequences * recipe["epochs"]
    wanted_recipe = training.Recipe(use=wanted, **recipe)
    click.echo(_plan(source, validation, wanted_recipe), err=True)
    after_epoch = _Follower(log).follow
    try:
        with naming(folder or out), shown_progress("Deep Scale", total=total) as progress:
            epochs = training.train(
                source=source,
                validation=training.Validation(validation),
                recipe=wanted_recipe,
                out=out,
                start=weights,
                device=device,
                progress=progress,
                after_epoch=after_epoch,
            )
    except OSError as error:
        name = error.filename or out
        raise click.BadParameter(f"{name} cannot be written: {error.strerror}.", param_hint="--out") from None
    except training.DeviceMissing:
        message = "--device cuda needs a graphics card that torch can use; expected cpu here."
        raise click.UsageError(message) from None
    _report(epochs, out=out, as_json=as_json)


def _start(path: Path) -> Weights:
    from tsttc_baselines.deep_scale.weights import read_weights  # noqa: PLC0415 -- --help can do without OpenCV

    with naming(path):
        return read_weights(path)


def _use(recipe: dict[str, Any], *, start: Weights | None) -> Use:
    """Take the card's settings of a start, or the options in `recipe`; raises `UsageError` for conflicts."""
    from tsttc_baselines.deep_scale.weights import Use  # noqa: PLC0415 -- as above

    use = Use(similarity="cosine") if start is None else start.use
    given = {name: value for name in _USE if (value := recipe.pop(name)) is not None}
    wrong = [name for name, value in given.items() if start is not None and value != getattr(use, name)]
    if wrong:
        raise click.UsageError(" ".join(_contradiction(name, given[name], use) for name in wrong))
    if recipe["fit_weight"] is None:
        recipe["fit_weight"] = 1.0 if use.decoding == "fit" else 0.0
    return replace(use, **given, decoding="fit" if recipe["fit_weight"] else use.decoding)


def _contradiction(name: str, value: Any, use: Use) -> str:
    flag, words = _USE[name]
    given = value if isinstance(value, str) else f"{value:g}"
    return (
        f"{flag} {given} contradicts the weights of --start, which were trained with "
        f"{words.format(getattr(use, name))}; leave it out, or start without weights."
    )


def _rendered(n_sequences: int, *, seed: int) -> Source:
    import numpy as np  # noqa: PLC0415 -- --help can do without

    from tsttc_baselines.pairs import RenderedSequences  # noqa: PLC0415 -- as above
    from tsttc_baselines.simulation import split  # noqa: PLC0415 -- as above

    drawn = split(
        rng=np.random.default_rng(seed), n_sequences=n_sequences, n_recordings=max(1, n_sequences // 40)
    )
    return RenderedSequences(drawn, seed=seed)


def _folder_source(path: Path) -> Source:
    from tsttc_baselines.pairs import FolderSequences  # noqa: PLC0415 -- --help can do without

    with naming(path):
        return FolderSequences.read(path)


def _plan(source: Source, validation: Source, recipe: Recipe) -> str:
    learned, scored = (counted(each.truth.n_sequences, "sequence") for each in (source, validation))
    return (
        f"{counted(recipe.epochs, 'epoch')} of {learned}, scored on {scored}; learning rate up to "
        f"{recipe.lr_per_pair * recipe.batch:.3g}."
    )


class _Follower:
    """Prints a line for each epoch on standard error, and keeps the log up to date."""

    def __init__(self, log: Path | None) -> None:
        self._log = log
        self._n_printed: int | None = None

    def follow(self, epochs: Sequence[Epoch]) -> None:
        """Take the epochs until now; the first call has those from before."""
        if self._n_printed is None and epochs and epochs[-1].number:
            click.echo(f"The interrupted training continues after epoch {epochs[-1].number}.", err=True)
        for epoch in epochs[self._n_printed or 0 :]:
            click.echo(_in_words(epoch), err=True)
        self._n_printed = len(epochs)
        if self._log is not None:
            self._log.write_text("\n".join([_LOG_HEADER, *map(_log_line, epochs), ""]))


def _in_words(epoch: Epoch) -> str:
    prefix = f"epoch {epoch.number}: loss {epoch.loss:.3f}, " if epoch.number else "before epoch 1: "
    line = f"{prefix}MiD {epoch.mid:.1f}, RTE {epoch.rte:.1f}%"
    if epoch.learning_rate is not None:
        line += f", learning rate {epoch.learning_rate:.3g}"
    if epoch.n_left_out:
        line += f"; {counted(epoch.n_left_out, 'sequence')} left out"
    return line


_LOG_HEADER: Final = (
    "epoch,learning_rate,loss,n_left_out,mid,rte,mid_crucial,mid_small,mid_large,mid_negative"
)


def _log_line(epoch: Epoch) -> str:
    values = [epoch.number, epoch.learning_rate, epoch.loss, epoch.n_left_out, epoch.mid, epoch.rte]
    by_range = [epoch.mid_by_range.get(name) for name in ("crucial", "small", "large", "negative")]
    return ",".join("" if value is None else str(value) for value in (*values, *by_range))


def _report(epochs: list[Epoch], *, out: Path, as_json: bool) -> None:
    trained = [epoch for epoch in epochs if epoch.number]
    best = min(trained, key=lambda epoch: epoch.mid)
    if as_json:
        echo_json({"output": str(out), "best": best.number, "epochs": [asdict(epoch) for epoch in epochs]})
        return
    click.echo(f"{out}: epoch {best.number} of {len(trained)}, MiD {best.mid:.1f}, RTE {best.rte:.1f}%.")
