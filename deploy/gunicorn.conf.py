"""gunicorn's settings: `gunicorn --config deploy/gunicorn.conf.py leaderboard.wsgi:application`.

It stands behind a proxy that buffers requests, so a slow upload never occupies a thread here.
"""

import os

bind = os.environ.get("TSTTC_WEB_BIND", "0.0.0.0:8000")
# The number of processes is gunicorn's own variable, WEB_CONCURRENCY.
worker_class = "gthread"
threads = int(os.environ.get("TSTTC_WEB_THREADS", "8"))
# Each process has its own listening socket. With a shared one, kept-alive connections pile up on one process.
reuse_port = True
keepalive = 30
timeout = 60
graceful_timeout = 30
accesslog = "-"
