"""gunicorn's settings: `gunicorn --config deploy/gunicorn.conf.py leaderboard.wsgi:application`.

It stands behind a proxy that buffers requests, so a slow upload never occupies a thread here.
"""

import os

from leaderboard.logs import logging_settings

bind = os.environ.get("TSTTC_WEB_BIND", "0.0.0.0:8000")
# The number of processes is gunicorn's own variable, WEB_CONCURRENCY.
worker_class = "gthread"
threads = int(os.environ.get("TSTTC_WEB_THREADS", "8"))
# Each process has its own listening socket. With a shared one, kept-alive connections pile up on one process.
reuse_port = True
keepalive = 30
timeout = 60
graceful_timeout = 30
# The application writes a line for each request, with its id and without what people type; gunicorn's own
# would have the keys of mailed links in it.
accesslog = None
logconfig_dict = logging_settings(as_json=True, level="INFO")
