"""gunicorn's settings: `gunicorn --config deploy/gunicorn.conf.py leaderboard.wsgi:application`.

It stands behind a proxy that buffers requests, so a slow upload never occupies a thread here.
"""

import os
import shutil
import tempfile
from typing import Any

from leaderboard.ops.logs import logging_settings

bind = os.environ.get("TSTTC_WEB_BIND", "0.0.0.0:8000")
# The number of processes is gunicorn's own variable, WEB_CONCURRENCY.
worker_class = "gthread"
threads = int(os.environ.get("TSTTC_WEB_THREADS", "8"))
# Each process has its own listening socket. With a shared one, kept-alive connections pile up on one process.
reuse_port = True
keepalive = 30
# No request says where the site is. From a proxy on this machine gunicorn would take SCRIPT_NAME, which a
# visitor may have sent. The application reads X-Forwarded-Proto itself.
forwarded_allow_ips = ""
forwarder_headers = ""
timeout = 60
graceful_timeout = 30
# The application writes a line for each request, with its id and without what people type; gunicorn's own
# would have the keys of mailed links in it.
accesslog = None
# Nobody steers it from outside; it would want a folder in the home of an account that has none.
control_socket_disable = True
logconfig_dict = logging_settings(as_json=True, level="INFO")


# All processes count their answers here, so that a scrape of one has the sum; before any of them is made.
if "PROMETHEUS_MULTIPROC_DIR" not in os.environ:
    os.environ["PROMETHEUS_MULTIPROC_DIR"] = tempfile.mkdtemp(prefix="tsttc-figures-")


def when_ready(server: Any) -> None:
    """Say where: with a socket for each process, gunicorn's own line names no address."""
    server.log.info("Each process listens at %s", bind)


def on_exit(server: Any) -> None:
    """The figures end with the processes."""
    shutil.rmtree(os.environ["PROMETHEUS_MULTIPROC_DIR"], ignore_errors=True)
