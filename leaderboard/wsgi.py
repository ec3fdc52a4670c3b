"""The WSGI entry for gunicorn and waitress."""

import os

from django.core.exceptions import ImproperlyConfigured
from django.core.wsgi import get_wsgi_application

from leaderboard.ops import environment

if environment.PROCESS != "web":
    # It would sign sessions and receipts with a key that ends with it.
    raise ImproperlyConfigured(
        f"TSTTC_PROCESS is {environment.PROCESS!r}; expected 'web', which alone has the keys to serve pages."
    )
os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")

application = get_wsgi_application()
