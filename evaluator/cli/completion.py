"""The subcommand completion: what a shell needs to complete the command's words."""

from __future__ import annotations

import click

VARIABLE = "_TSTTC_COMPLETE"
SHELLS = ("bash", "zsh", "fish")


@click.command(short_help="Print the completion script for your shell.")
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the completion script for SHELL; put it where the shell reads it.

    \b
    Examples:
      tsttc completion bash > ~/.local/share/bash-completion/completions/tsttc
      tsttc completion zsh > ~/.zfunc/_tsttc
      tsttc completion fish > ~/.config/fish/completions/tsttc.fish
    """
    from click.shell_completion import get_completion_class  # noqa: PLC0415 -- needed here alone

    completion_class = get_completion_class(shell)
    assert completion_class is not None  # noqa: S101 -- click knows these three
    root = context.find_root()
    maker = completion_class(root.command, {}, root.info_name or "tsttc", VARIABLE)
    # Not `source()`: that asks bash for its version, and this may be written for another machine's.
    click.echo(maker.source_template % maker.source_vars())
