"""`manage.py demo`: everything in one terminal, on SQLite and without a broker."""

import asyncio
import io
import logging
import os
import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.conf import settings
from django.contrib.staticfiles.finders import get_finders
from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandError

from leaderboard.demo.seed import SPLIT
from leaderboard.demo.supervisor import Process, StartFailed, port_is_free, supervise
from leaderboard.management.commands.build_wheel import build, is_built
from leaderboard.models import Split

# Connections at once, half-open ones among them: fewer than the files that a process may open.
MAX_CONNECTIONS = 900
SILENT_S = 20
ANYWHERE = frozenset({"", "0.0.0.0", "::"})  # noqa: S104 - nothing is bound here


class Command(BaseCommand):
    help = "Migrate, seed, and run web server and worker until Ctrl-C."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--host", default="127.0.0.1")
        parser.add_argument("--port", type=int, default=8000)

    def handle(self, *args: Any, **options: Any) -> None:
        host, port = options["host"], options["port"]
        if settings.PRODUCTION:
            raise CommandError("The demo is for the embedded profile; TSTTC_PROFILE says production.")
        if not port_is_free(host, port):
            raise CommandError(
                f"Port {port} on {host} is in use. "
                "Stop the program there, or choose another port: make demo PORT=8010"
            )
        # Database, logs and mails in them are for their owner alone.
        os.umask(0o077)
        # What the processes have to say is in their logs, and what the seed did is on the board.
        logging.disable(logging.WARNING)
        self._say("Preparing database, static files and simulated data …\n")
        call_command("migrate", verbosity=0)
        if static_files_changed(Path(settings.STATIC_ROOT)):
            call_command("collectstatic", interactive=False, clear=True, verbosity=0)
        if not is_built():
            build()
        login = io.StringIO()
        # Another benchmark has no such split: the leaderboard is served as it is.
        is_simulated = Split.objects.filter(pk=SPLIT).exists()
        if is_simulated:
            call_command("seed_demo", stdout=login)
        address = f"http://{host}:{port}"
        board = f"/board/{SPLIT}/" if is_simulated else "/board/"
        banner = (
            f"\nThe leaderboard is at {address}{board}\n{login.getvalue()}"
            f"{'Its ground truth is simulated. ' if is_simulated else ''}Ctrl-C ends it. "
            f"Logs are in {settings.DATA_DIR / 'logs'}, mails in {settings.DATA_DIR / 'mail'}\n"
        )
        try:
            running = processes(host, port, address=address)
            asyncio.run(supervise(running, host=host, port=port, ready=lambda: self._say(banner)))
        except StartFailed as fault:
            raise CommandError(str(fault)) from fault

    def _say(self, text: str) -> None:
        self.stdout.write(text, ending="")
        self.stdout.flush()


def static_files_changed(root: Path) -> bool:
    """Tell whether a static file is newer than the collected ones."""
    collected = root / "staticfiles.json"
    if not collected.exists():
        return True
    collected_s = collected.stat().st_mtime
    return any(
        Path(storage.path(name)).stat().st_mtime > collected_s
        for finder in get_finders()
        for name, storage in finder.list([])
    )


def names_of(host: str) -> list[str]:
    """Return the host names that browsers may use: a foreign page could point its own name here."""
    if host in ANYWHERE:
        return ["*"]
    return ["localhost", "127.0.0.1", "[::1]", f"[{host}]" if ":" in host else host]


def processes(host: str, port: int, *, address: str) -> list[Process]:
    """The web server and the worker of the demo."""
    logs = settings.DATA_DIR / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    environment = {
        "TSTTC_SITE_URL": address,
        "TSTTC_ALLOWED_HOSTS": ",".join(names_of(host)),
        "OPENBLAS_NUM_THREADS": "1",
        **os.environ,
    }
    web = [
        *(sys.executable, "-m", "waitress", f"--host={host}", f"--port={port}", "--threads=8"),
        # What is too large the application says, in the words of the page or the API.
        f"--max-request-body-size={10 * settings.MAX_PREDICTIONS_BYTES}",
        *(f"--connection-limit={MAX_CONNECTIONS}", f"--channel-timeout={SILENT_S}", "--asyncore-use-poll"),
        "leaderboard.wsgi:application",
    ]
    worker = [
        *(sys.executable, "-m", "celery", "-A", "leaderboard", "worker", "-P", "solo"),
        *("--without-gossip", "--without-mingle", "--without-heartbeat", "--loglevel=info"),
    ]
    return [
        Process("web", web, logs / "web.log", environment),
        Process("worker", worker, logs / "worker.log", environment),
    ]
