#!/usr/bin/env python
"""Command-line entry of the leaderboard."""

import os
import signal
import sys


def main() -> None:
    """Run a management command with the project's settings."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    if sys.argv[1:2] == ["make_receipt_key"]:
        make_receipt_key()
        return
    if os.environ.get("TSTTC_PROFILE") == "production":
        # Commands read hidden values, keys and addresses: other processes of their account do not.
        from evaluator.limits import keep_memory_private  # noqa: PLC0415 - nothing of it is on Windows

        keep_memory_private()
    from django.core.exceptions import ImproperlyConfigured  # noqa: PLC0415 - settings come first
    from django.core.management import execute_from_command_line  # noqa: PLC0415 - settings come first

    try:
        execute_from_command_line(sys.argv)
        sys.stdout.flush()
    except ImproperlyConfigured as fault:
        # A sentence for each variable; where in the code it was read helps nobody.
        sys.exit(f"The settings are wrong:\n{fault}")
    except BrokenPipeError:
        # Whoever read the output, as `head` does, has left: the shell's number for that, and nothing to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(128 + signal.SIGPIPE)


def make_receipt_key() -> None:
    """Run the one command that makes a required variable: without the settings, which would ask for it."""
    from django.conf import settings  # noqa: PLC0415 - only here are there no settings to wait for

    settings.configure()
    from leaderboard.management.commands.make_receipt_key import Command  # noqa: PLC0415 - settings come first

    Command().run_from_argv(sys.argv)


if __name__ == "__main__":
    main()
