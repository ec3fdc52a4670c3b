"""Run the leaderboard's tests on PostgreSQL: `python -m tests.on_postgresql [pytest arguments]`.

The suite itself runs on SQLite, where it needs nothing. The verbs are meant for both, so this repeats
`tests/leaderboard` on the real thing where it is reachable, and says so where it is not. The whole run is to
end within 13 minutes: what asks no database is left out, and what cannot differ by database (`SAME_ON_BOTH`).
"""

import os
import secrets
import subprocess
import sys
from pathlib import Path

from tests import spread
from tests.services import REPOSITORY, REQUIRED, ServiceMissing, check_postgres, database_url

# The other half of the processors has the rest of the suite (see `tests/everything.py`).
N_PROCESSES = max(1, (os.cpu_count() or 1) // 2)
# What cannot differ by database, and why. Repeated is what writes rows, and what asks for them in a way of
# its own: locks, raw SQL, constraints, transactions, order, JSON, dates. Left out is what makes words,
# figures or bytes of rows that another file reads on both. A file with a test for PostgreSQL alone stays.
SAME_ON_BOTH = {
    "tests/leaderboard/web": "pages; the journeys draw them from PostgreSQL",
    "tests/leaderboard/demo": "it refuses production, and its profile has SQLite",
    "tests/leaderboard/exports": "bytes of a board; boards/ reads its rows",
    "tests/leaderboard/api/test_board.py": "answers; boards/ reads the rows",
    "tests/leaderboard/api/test_compare.py": "answers; scoring/test_questions.py asks for the rows",
    "tests/leaderboard/api/test_conditional.py": "tags of answers",
    "tests/leaderboard/api/test_outcome.py": "answers; scoring/test_confidence.py reads the rows",
    "tests/leaderboard/api/test_problems.py": "words of refusals",
    "tests/leaderboard/api/test_quota.py": "answers; quotas/ reads the rows",
    "tests/leaderboard/api/test_throttling.py": "answers; ops/test_rate_limits.py counts",
    "tests/leaderboard/ops/test_logs.py": "lines of a log",
    "tests/leaderboard/storage/test_files_s3.py": "bytes in a bucket",
    "tests/leaderboard/scoring/test_comparisons.py": "figures of pairs; test_questions.py asks for the rows",
    "tests/leaderboard/scoring/test_disclosure.py": "figures, rounded",
    "tests/leaderboard/scoring/test_floors.py": "figures",
    "tests/leaderboard/scoring/test_sandbox.py": "a child process that reads a file",
    "tests/leaderboard/scoring/test_warnings.py": "words about a file",
    "tests/leaderboard/scoring/test_confidence_on_real_driving.py": "figures; a journey has its own",
    "tests/leaderboard/editions/test_corrections_on_real_driving.py": "figures; other files correct",
}
WHOLE = [
    *("-q", "-n", str(N_PROCESSES), *spread.OPTIONS),
    *(f"--ignore={path}" for path in SAME_ON_BOTH),
    "tests/leaderboard",
]


def main() -> int:
    """Run pytest with a database of its own. Without a PostgreSQL, 0 unless one is required."""
    missing_paths = [path for path in SAME_ON_BOTH if not (REPOSITORY / path).exists()]
    assert not missing_paths, missing_paths
    needed = [str(path) for path in _left_out() if "connection.vendor" in path.read_text()]
    assert not needed, f"have tests for PostgreSQL alone: {needed}"
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


def _left_out() -> list[Path]:
    """The files that are not repeated."""
    folders = [REPOSITORY / path for path in SAME_ON_BOTH]
    return [path for folder in folders for path in (folder.rglob("*.py") if folder.is_dir() else [folder])]


if __name__ == "__main__":
    sys.exit(main())
