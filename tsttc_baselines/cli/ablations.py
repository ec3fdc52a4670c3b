"""`tsttc baseline ablate`: one setting of Pixel MSE varied, with the paper's table next to the own scores."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned
from evaluator.cli.options import default_option, json_option
from evaluator.cli.reading import FOLDER, naming
from evaluator.counting import counted
from tsttc_baselines.cli import require_opencv
from tsttc_baselines.cli.options import jobs_option, truth_option

if TYPE_CHECKING:
    from tsttc_baselines.ablation import Ablation, AblationRow

NAMES: Final = ("bins", "frame-gap", "shift", "expansion")


@click.command(short_help="Vary a setting of Pixel MSE, beside the paper's table.")
@click.argument("name", metavar="bins|frame-gap|shift|expansion", type=click.Choice(NAMES))
@click.argument("folder", type=FOLDER)
@truth_option(
    "Ground truth: a CSV file or an annotation folder. [default: truth.csv in FOLDER, or FOLDER itself]"
)
@default_option("--variant", type=click.Choice(("paper", "toolkit")), default="paper", help="Of Pixel MSE.")
@jobs_option
@json_option
def ablate(
    *, name: str, folder: Path, truth_path: Path | None, variant: str, n_processes: int, as_json: bool
) -> None:
    """Run Pixel MSE on FOLDER for each value of one setting, and print its scores next to the paper's.

    The paper's numbers are of TSTTC's validation split. On other recordings the errors are different:
    compare only how they change from one value to the next. The paper has no table for the expansion.

    \b
    Examples:
      tsttc baseline ablate frame-gap val/
      tsttc baseline ablate bins frames/ --truth val.csv --json
    """
    require_opencv()
    from evaluator import read_truth  # noqa: PLC0415 -- numpy, which --help can do without
    from tsttc_baselines.ablation import (  # noqa: PLC0415 -- needs OpenCV
        get_ablation,
        scores_of_settings,
    )
    from tsttc_baselines.cli.progress import shown_progress  # noqa: PLC0415 -- as above
    from tsttc_baselines.folders import read_folder, read_folder_truth  # noqa: PLC0415 -- as above

    ablation = get_ablation(name)
    with naming(truth_path or folder):
        truth = read_truth(truth_path) if truth_path else read_folder_truth(folder)
    with naming(folder):
        sequences = read_folder(folder)
        n_estimates = len(ablation.settings) * sequences.n_sequences
        with shown_progress(ablation.title, total=n_estimates) as progress:
            rows = scores_of_settings(
                ablation,
                folder=sequences,
                truth=truth,
                parameters={"variant": variant},
                n_processes=n_processes,
                progress=progress,
            )
    if as_json:
        echo_json(_document(ablation, rows, variant=variant, n_sequences=sequences.n_sequences))
        return
    click.echo("\n".join(_in_words(ablation, rows, n_sequences=sequences.n_sequences)))


def _document(
    ablation: Ablation, rows: list[AblationRow], *, variant: str, n_sequences: int
) -> dict[str, object]:
    return {
        "ablation": ablation.name,
        "method": "pixel-mse",
        "variant": variant,
        "default": ablation.default,
        "published_table": ablation.table,
        "n_sequences": n_sequences,
        "rows": [asdict(row) for row in rows],
    }


def _in_words(ablation: Ablation, rows: list[AblationRow], *, n_sequences: int) -> list[str]:
    heads = [ablation.title.lower(), "MiD paper", "MiD here", "RTE paper", "RTE here", "fallbacks"]
    lines = [[Cell(text, is_bold=True) for text in heads]]
    for row in rows:
        values = [of[metric] for metric in ("mid", "rte") for of in (row.published, row.scores)]
        shown = [NO_VALUE if value is None else f"{value:.1f}" for value in values]
        setting = f"{row.setting} (default)" if row.setting == ablation.default else str(row.setting)
        lines.append([Cell(text) for text in (setting, *shown, f"{row.n_fallback:,}")])
    notes = [f"MiD ×10⁻⁴, RTE %, lower is better; {counted(n_sequences, 'sequence')} here."]
    if ablation.table is None:
        notes.append(f"The paper has no table for this: its boxes are enlarged by {ablation.default}.")
    else:
        notes.append("The paper's numbers are of TSTTC's validation split: compare how they change.")
    missing = [str(row.setting) for row in rows if row.scores["mid"] is None]
    if missing:
        notes.append(f"No sequence has a box in the reference frame of the settings {', '.join(missing)}.")
    return [*aligned(lines, align="<....>"), "", *notes]
