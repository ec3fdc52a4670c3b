"""What a worker process more is worth: submissions scored per second by 1, 2 and 4 of them.

Real Celery workers (prefork, one process each), a PostgreSQL database and a Redis database of this run's own.
`benchmarks/_scaling.py` is the measurement itself.

`python -m benchmarks scale_out`
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.journeys.production import REPOSITORY, settings_for
from tests.services import throwaway_database, throwaway_redis

# Django's models can be imported once the settings are known, and those once the services are.
_MEASURE = "import django; django.setup(); from benchmarks import _scaling; _scaling.main()"


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with (
        throwaway_database() as postgres_url,
        throwaway_redis() as redis_url,
        tempfile.TemporaryDirectory(prefix="scale-out-") as folder,
    ):
        settings = settings_for(
            Path(folder), url="http://127.0.0.1", postgres_url=postgres_url, redis_url=redis_url
        )
        environment = {
            **settings,
            "DJANGO_SETTINGS_MODULE": "leaderboard.settings",
            "TSTTC_LOG_LEVEL": "WARNING",
            "TSTTC_QUOTAS": "0",
            "TSTTC_THROTTLES": "0",
        }
        print(f"scale_out_processors = {os.cpu_count()} processors")
        sys.stdout.flush()
        subprocess.run([sys.executable, "-c", _MEASURE], cwd=REPOSITORY, env=environment, check=True)


if __name__ == "__main__":
    main()
