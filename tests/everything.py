"""The whole suite, as `make test` runs it: `python -m tests.everything [pytest arguments]`.

It runs once, on PostgreSQL where that answers and on SQLite where it does not. What asks the database for
something that the two do differently then runs on SQLite, too.
"""

import os
import secrets
import subprocess
import sys
from collections.abc import Sequence

from tests import prepared, spread
from tests.services import REQUIRED, ServiceMissing, check_postgres, database_url

# Locks, one writer at a time, constraints, order, JSON and dates.
ON_SQLITE_TOO = (
    "tests/leaderboard/db",
    "tests/leaderboard/boards",
    "tests/leaderboard/quotas",
    "tests/leaderboard/queue/test_lifecycle.py",
    "tests/leaderboard/queue/test_lifecycle_states.py",
    "tests/leaderboard/statistics/test_comparison_queue.py",
    "tests/leaderboard/submissions",
)


def main() -> int:
    """0 if everything was good."""
    arguments = sys.argv[1:]
    prepared.begin()
    try:
        check_postgres()
    except ServiceMissing as missing:
        sys.stdout.write(f"The suite runs on SQLite alone: {missing}\n")
        sys.stdout.flush()
        return 1 if REQUIRED else _pytest(arguments)
    # pytest-django makes and drops a database called test_ and this name.
    code = _pytest(arguments, TSTTC_DATABASE_URL=database_url(f"tsttc_{secrets.token_hex(6)}"))
    return code if arguments else code or _pytest(ON_SQLITE_TOO)


def _pytest(arguments: Sequence[str], **environment: str) -> int:
    # Two processes more than processors: browsers, servers and workers are waited for.
    n_processes = str((os.cpu_count() or 1) + 2)
    command = [sys.executable, "-m", "pytest", "-q", "-n", n_processes, *spread.OPTIONS, *arguments]
    return subprocess.run(command, env=os.environ | environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
