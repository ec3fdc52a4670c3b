"""`tsttc` as a process of its own, with nothing of the machine's own settings, copies and keyrings."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.journeys.production import REPOSITORY

EXAMPLES = REPOSITORY / "examples"
TIMEOUT_S = 180

Done = subprocess.CompletedProcess[str]
Tsttc = Callable[..., Done]


def environment(url: str, token: str | Path, *, home: Path) -> dict[str, str]:
    """Where the command finds its server, its token, or the file with it, and a home of its own."""
    return os.environ | {
        "TSTTC_URL": url,
        "TSTTC_TOKEN_FILE" if isinstance(token, Path) else "TSTTC_TOKEN": str(token),
        "PYTHONPATH": str(REPOSITORY),
        "XDG_CONFIG_HOME": str(home / "config"),
        "PYTHON_KEYRING_BACKEND": "keyring.backends.fail.Keyring",
    }


def command(url: str, token: str | Path, *, home: Path) -> Tsttc:
    """The command with that token for that address, called from the folder of examples."""
    surroundings = environment(url, token, home=home)

    def run(*arguments: object) -> Done:
        return subprocess.run(
            [sys.executable, "-m", "evaluator", *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
            cwd=EXAMPLES,
            env=surroundings,
            timeout=TIMEOUT_S,
        )

    return run
