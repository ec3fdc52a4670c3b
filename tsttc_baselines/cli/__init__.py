"""The group `tsttc baseline`: one module per subcommand, imported on use. `COMMANDS` lists them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Final

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure

COMMANDS: Final = {
    "list": "tsttc_baselines.cli.listing:list_methods",
    "run": "tsttc_baselines.cli.runs:run",
    "train": "tsttc_baselines.cli.training:train",
    "simulate": "tsttc_baselines.cli.simulations:simulate",
    "render": "tsttc_baselines.cli.simulations:render",
    "annotate": "tsttc_baselines.cli.annotations:annotate",
    "noise": "tsttc_baselines.cli.noise:noise",
    "ablate": "tsttc_baselines.cli.ablations:ablate",
    "show": "tsttc_baselines.cli.showing:show",
}
"""Each subcommand, in the order of the help, with its module and the name of its command there."""


class _Subcommands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(import_module(module), name)
        return command


@click.group(cls=_Subcommands, short_help="Run the paper's baselines on frames and boxes.")
def baseline() -> None:
    """Run the paper's baselines on a folder of frames and boxes.

    The commands run on your computer and send nothing.
    """


def require_opencv() -> None:
    if find_spec("cv2") is None:
        message = "The baselines need OpenCV; install it with: pip install opencv-python-headless"
        raise Failure(message, exit_code=Exit.USAGE, code="no-opencv")
