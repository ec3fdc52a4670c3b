"""`python -m benchmarks [NAME …]`: run every benchmark of this folder, or those named.

A benchmark is a module with a function `main()` that measures and prints one line per figure, `name = value
unit`. Each runs in a process of its own, so that none measures what another left in memory.
"""

import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Every benchmark here."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def main() -> int:
    """Run them in turn; the exit code is the first that was not 0."""
    chosen = sys.argv[1:] or names()
    unknown = sorted(set(chosen) - set(names()))
    if unknown:
        sys.exit(f"There is no benchmark {', '.join(unknown)}; expected some of: {', '.join(names())}")
    codes = [
        subprocess.run(
            [sys.executable, "-c", f"from benchmarks import {name}; {name}.main()"],
            cwd=FOLDER.parent,
            check=False,
        ).returncode
        for name in chosen
    ]
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
