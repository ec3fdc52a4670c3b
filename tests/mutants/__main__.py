"""`python -m tests.mutants boards --seed 3 --number 60`: small faults, and whether a test notices them.

The last commit is checked out beside, and its tests run there. What a room's tests run is kept in
`build/mutants/` until the room or the file of the test changes.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.mutants import allowing
from tests.mutants.rooms import ROOMS

REPOSITORY = Path(__file__).resolve().parents[2]
# What needs more than this process.
LEFT_OUT = "not browser and not services and not torch"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("room", choices=sorted(ROOMS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=60, help="of faults")
    parser.add_argument("--at", default="", help="FILE or FILE:LINE: all faults there")
    parser.add_argument("--seconds", type=float, default=60.0, help="for the tests of a fault")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    return parser.parse_args()


def main() -> int:
    """0 unless the tests could not be run."""
    options = arguments()
    room = ROOMS[options.room]
    seen = REPOSITORY / "build/mutants" / f"{options.room}-{_checksum(options.room)}.json"
    environment = os.environ | {
        "OPENBLAS_NUM_THREADS": "1",
        "TSTTC_SHARED_DATA": os.environ.get("TSTTC_SHARED_DATA", str(REPOSITORY.parent / "shared/data")),
    }
    environment.pop("TSTTC_DATABASE_URL", None)  # SQLite in memory comes along in a fork
    words = ["-q", "-n", "0", "--capture=sys", "-p", "no:cacheprovider", "-p", "tests.mutants.inside"]
    with tempfile.TemporaryDirectory(prefix="tsttc-mutants-") as folder:
        tree = Path(folder) / "tree"
        _git("worktree", "add", "--quiet", "--detach", str(tree), "HEAD")
        more = {"root": str(tree), "sources": room.sources, "seen": str(seen), "allowed": str(allowing.LIST)}
        environment["TSTTC_MUTANTS"] = json.dumps(vars(options) | more)
        try:
            command = [sys.executable, "-m", "pytest", *words, "-m", LEFT_OUT, *room.tests]
            return subprocess.run(command, cwd=tree, env=environment, check=False).returncode
        finally:
            _git("worktree", "remove", "--force", str(tree))


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=REPOSITORY, check=True, capture_output=True, text=True).stdout


def _checksum(room: str) -> str:
    """Another one if the room or the way of looking has changed."""
    listed = _git("ls-tree", "-r", "HEAD", "--", *ROOMS[room].sources, "tests/mutants/running.py")
    return hashlib.sha256(listed.encode()).hexdigest()[:16]


if __name__ == "__main__":
    sys.exit(main())
