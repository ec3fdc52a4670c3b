"""Let all verbs that take locks meet, on PostgreSQL, fifty times: `python -m tests.deadlocks [rounds]`.

The suite does one round (`tests/leaderboard/db/test_deadlocks.py`). This takes about half an hour and prints
how many rounds, waits, deadlocks and answers 503 there were.
"""

import os
import sys

from tests import on_postgresql

N_ROUNDS = 50


def main() -> int:
    """Run the tests with so many rounds."""
    os.environ["TSTTC_DEADLOCK_ROUNDS"] = sys.argv[1] if len(sys.argv) > 1 else str(N_ROUNDS)
    files = "tests/leaderboard/db/test_deadlocks.py"
    sys.argv[1:] = ["-q", "-s", "-p", "no:xdist", "--log-disable=leaderboard", files]
    return on_postgresql.main()


if __name__ == "__main__":
    sys.exit(main())
