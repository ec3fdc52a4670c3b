#!/usr/bin/env python
"""Command-line entry of the leaderboard."""

import os
import sys


def main() -> None:
    """Run a management command with the project's settings."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    from django.core.exceptions import ImproperlyConfigured  # noqa: PLC0415 - settings come first
    from django.core.management import execute_from_command_line  # noqa: PLC0415 - settings come first

    try:
        execute_from_command_line(sys.argv)
    except ImproperlyConfigured as fault:
        # A sentence for each variable; where in the code it was read helps nobody.
        sys.exit(f"The settings are wrong:\n{fault}")


if __name__ == "__main__":
    main()
