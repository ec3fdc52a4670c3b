"""`tsttc baseline run`: a method over a folder, into a prediction file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import printable
from evaluator.cli.options import json_option
from evaluator.cli.reading import FOLDER, naming
from evaluator.counting import counted
from tsttc_baselines.cli import require_opencv
from tsttc_baselines.cli.options import gap_option, jobs_option, keys_option, out_option, require_writable
from tsttc_baselines.methods import METHODS, Method, Parameter, Value
from tsttc_baselines.own_methods import MethodMissing, find_method, is_own, line_of

if TYPE_CHECKING:
    from tsttc_baselines.running import Run

Command = Callable[..., Any]


def _method_options(command: Command) -> Command:
    # Methods share an option of one name.
    shared: dict[str, dict[str, Parameter]] = {}
    for method in METHODS:
        for parameter in method.parameters:
            shared.setdefault(parameter.name, {})[method.name] = parameter
    for of_method in reversed(shared.values()):
        command = _option(of_method)(command)
    return command


def _option(of_method: Mapping[str, Parameter]) -> Callable[[Command], Command]:
    parameter = next(iter(of_method.values()))
    kind = _type_of(parameter)
    defaults = [
        f"{method} {other.default_in_words}"
        for method, other in of_method.items()
        if other.default is not None
    ]
    default = f" [default: {', '.join(defaults)}]" if defaults else ""
    return click.option(
        parameter.option,
        parameter.name,
        type=kind,
        default=None,
        help=f"Of {', '.join(of_method)}: {parameter.help}{default}",
    )


def _type_of(parameter: Parameter) -> click.ParamType[Any]:
    if parameter.choices:
        return click.Choice(parameter.choices)
    if parameter.kind is int:
        return click.IntRange(_whole(parameter.low), _whole(parameter.high))
    if parameter.kind is float:
        return click.FloatRange(parameter.low, parameter.high)
    if parameter.kind is Path:
        return click.Path(exists=True, dir_okay=False, path_type=Path)
    return click.STRING


def _whole(end: float | None) -> int | None:
    return None if end is None else int(end)


@click.command(short_help="Run a method over a folder, into a prediction file.")
@click.argument("method", metavar="METHOD", callback=lambda _c, _p, name: _method(name))
@click.argument("folder", type=FOLDER)
@out_option("Write the predictions to this file.")
@gap_option
@_method_options
@click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE", help="A parameter of a method of yours."
)
@keys_option
@jobs_option
@click.option("--strict", is_flag=True, help="Write nothing and exit 1 where a sequence needs a fallback.")
@json_option
def run(
    *,
    method: Method,
    folder: Path,
    out: Path,
    frame_gap: int,
    keys: Literal["natural", "anno-id"],
    n_processes: int,
    strict: bool,
    as_json: bool,
    settings: tuple[str, ...],
    **options: Value,
) -> None:
    """Run METHOD on every sequence of FOLDER and write a prediction file.

    METHOD is one of `tsttc baseline list`, or a class of yours as MODULE:NAME, from this folder or installed.
    FOLDER has manifest.csv, boxes.csv and images/, or is a folder of the dataset as it is downloaded. A
    sequence without an estimate gets the root of its boxes' area ratio, or 1; these fallbacks are counted.
    If a run is interrupted, the same command continues it.

    \b
    Examples:
      tsttc baseline run pixel-mse val/ --out pixel-mse.json
      tsttc baseline run detection val/ --out heights.json --measure height
      tsttc baseline run my_pkg.my_mod:Net val/ --out mine.json --set weights=net.pt
    """
    given = _given(method, options) | _set(method, settings)
    require_writable(out)
    require_opencv()
    from tsttc_baselines.cli.progress import shown_progress  # noqa: PLC0415 -- OpenCV, which --help can do without
    from tsttc_baselines.folders import read_folder  # noqa: PLC0415 -- as above
    from tsttc_baselines.journals import OutputInUse  # noqa: PLC0415 -- as above
    from tsttc_baselines.processes import WorkerEnded  # noqa: PLC0415 -- as above
    from tsttc_baselines.running import run_method  # noqa: PLC0415 -- as above

    _require_estimator(method, given)
    with naming(folder):
        sequences = read_folder(folder)
        try:
            with shown_progress(method.title, total=sequences.n_sequences) as progress:
                done = run_method(
                    folder=sequences,
                    method=method,
                    parameters=given,
                    frame_gap=frame_gap,
                    out=out,
                    keys="anno_id" if keys == "anno-id" else "natural_key",
                    n_processes=n_processes,
                    strict=strict,
                    progress=progress,
                )
        except OutputInUse:
            message = f"Another run writes {out}; wait for it, or name another file."
            raise Failure(message, exit_code=Exit.USAGE, code="output-in-use") from None
        except WorkerEnded:
            message = (
                "A process of the run ended, probably because memory ran out; "
                "the same command with fewer --jobs continues the run."
            )
            raise Failure(message, exit_code=Exit.REJECTED, code="worker-ended") from None
        except OSError as error:
            message = f"{out} cannot be written: {error.strerror}."
            raise click.BadParameter(message, param_hint="--out") from None
    _report(done, out=out, as_json=as_json)


def _method(name: str) -> Method:
    try:
        return find_method(name)
    except MethodMissing as missing:
        raise click.BadParameter(printable(str(missing))) from None


def _set(method: Method, settings: Sequence[str]) -> dict[str, Value]:
    """The parameters that --set gives, as their types; raises for one that the method does not have."""
    if settings and not is_own(method):
        raise click.UsageError(f"--set is for methods of yours; {method.name} has options instead.")
    known = {parameter.name: parameter for parameter in method.parameters}
    given: dict[str, Value] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in known:
            message = f"{setting}; expected NAME=VALUE, with a NAME of these: {', '.join(known) or 'none'}."
            raise click.BadParameter(message, param_hint="--set")
        try:
            given[name] = _type_of(known[name]).convert(text, None, None)
        except click.BadParameter as fault:
            raise click.BadParameter(fault.message, param_hint=f"--set {name}") from None
    return given


def _given(method: Method, options: Mapping[str, Value]) -> dict[str, Value]:
    given: dict[str, Value] = {name: value for name, value in options.items() if value is not None}
    known = {parameter.name: parameter.option for parameter in method.parameters}
    for name in given:
        if name not in known:
            option = "--" + name.replace("_", "-")
            expected = f"its options are {', '.join(known.values())}" if known else "it has no options"
            raise click.UsageError(f"{method.name} has no option {option}; {expected}.")
    return given


def _require_estimator(method: Method, given: Mapping[str, Value]) -> None:
    # Before the folder is read.
    try:
        filled = method.filled(given)
        weights = filled.get("weights")
        with naming(weights) if isinstance(weights, Path) else nullcontext():
            method.estimator(filled)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    except OSError as error:
        raise click.UsageError(f"{error.filename} cannot be read: {error.strerror}.") from None
    except Exception as error:
        if not is_own(method):
            raise
        cause = printable(f"{type(error).__name__}: {error}{line_of(error, method.factory)}")
        raise click.UsageError(f"The method {method.name} cannot be made ({cause}).") from None


def _report(done: Run, *, out: Path, as_json: bool) -> None:
    n_sequences = len(done.scale_ratio)
    n_fallback = sum(done.n_fallback.values())
    if as_json:
        echo_json(
            {
                "output": str(out),
                "n_sequences": n_sequences,
                "n_resumed": done.n_resumed,
                "seconds": round(done.seconds, 3),
                **done.meta,
                "examples": {reason: str(problem) for reason, problem in done.examples.items()},
            }
        )
        return
    resumed = f", {done.n_resumed:,} of them from the interrupted run" if done.n_resumed else ""
    click.echo(f"{out}: {counted(n_sequences, 'sequence')} in {done.seconds:.1f} s{resumed}.")
    if n_fallback:
        have = "has" if n_fallback == 1 else "have"
        click.echo(f"{n_fallback:,} of them {have} a fallback, from the boxes' areas or 1:", err=True)
    for reason, count in done.n_fallback.items():
        example = f" ({done.examples[reason]})" if reason in done.examples else ""
        click.echo(f"  {count:,}  {reason}{example}", err=True)
