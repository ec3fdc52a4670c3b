"""The proofs of docs/security.md in full: `python -m tests.security [pytest arguments]`.

The suite sends fewer examples of what is random or many; here all of them are sent, which takes minutes.
"""

import os
import subprocess
import sys
from pathlib import Path


def main() -> int:
    """Run the folder with everything that it has."""
    here = Path(__file__).parent
    arguments = sys.argv[1:] or ["-q", str(here)]
    environment = os.environ | {"TSTTC_SECURITY_WHOLE": "1"}
    return subprocess.run(
        [sys.executable, "-m", "pytest", *arguments], env=environment, check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
