"""Run the leaderboard's tests on PostgreSQL: `python -m tests.on_postgresql [pytest arguments]`.

The suite itself runs on SQLite, where it needs nothing. The verbs are meant for both, so this repeats
`tests/leaderboard` on the real thing where it is reachable, and says so where it is not. What asks no
database is left out, and what only draws pages: the journeys draw them from PostgreSQL, and the whole run is
to end within 13 minutes.
"""

import os
import secrets
import subprocess
import sys

from tests import spread
from tests.services import REQUIRED, ServiceMissing, check_postgres, database_url

# The other half of the processors has the rest of the suite (see `tests/everything.py`).
N_PROCESSES = max(1, (os.cpu_count() or 1) // 2)
WHOLE = [
    *("-q", "-n", str(N_PROCESSES), *spread.OPTIONS),
    *("--ignore=tests/leaderboard/web", "tests/leaderboard"),
]


def main() -> int:
    """Run pytest with a database of its own. Without a PostgreSQL, 0 unless one is required."""
    try:
        check_postgres()
    except ServiceMissing as missing:
        sys.stdout.write(f"The leaderboard's tests are not repeated on PostgreSQL: {missing}\n")
        return 1 if REQUIRED else 0
    sys.stdout.write("The leaderboard's tests on PostgreSQL:\n")
    sys.stdout.flush()
    # pytest-django makes and drops a database called test_ and this name.
    url = database_url(f"tsttc_{secrets.token_hex(6)}")
    arguments = sys.argv[1:] or WHOLE
    environment = {
        "TSTTC_DATABASE_URL": url,
        "TSTTC_DATABASE_ALONE": "1" if arguments is WHOLE else os.environ.get("TSTTC_DATABASE_ALONE", "0"),
    }
    command = [sys.executable, "-m", "pytest", *arguments]
    return subprocess.run(command, env=os.environ | environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
