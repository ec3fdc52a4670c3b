"""The whole suite, as `make test` runs it: `python -m tests.everything`.

The tests on PostgreSQL run beside the others and not before them: each has its pauses, in which it waits for
a server or for the disk, and the other one the processor. What they say comes at the end.
"""

import os
import shutil
import subprocess
import sys
import tempfile

from tests import prepared, spread


def main() -> int:
    """0 if both were good."""
    prepared.begin()  # what is made once is made once for both
    with tempfile.TemporaryFile() as said:
        beside = subprocess.Popen(
            [sys.executable, "-m", "tests.on_postgresql"], stdout=said, stderr=subprocess.STDOUT
        )
        try:
            # One process more than processors: browsers, servers and workers are waited for.
            n_processes = str((os.cpu_count() or 1) + 1)
            command = [sys.executable, "-m", "pytest", "-n", n_processes, *spread.OPTIONS]
            main_code = subprocess.run(command, check=False).returncode
            beside_code = beside.wait()
        finally:
            if beside.poll() is None:
                beside.terminate()
                beside.wait()
        said.seek(0)
        sys.stdout.flush()
        shutil.copyfileobj(said, sys.stdout.buffer)
        sys.stdout.flush()
    return 1 if main_code or beside_code else 0


if __name__ == "__main__":
    sys.exit(main())
