"""The WSGI entry for gunicorn and waitress."""

import os

from django.core.exceptions import ImproperlyConfigured
from django.core.wsgi import get_wsgi_application

from leaderboard.ops import environment
from leaderboard.web.middleware.unread_bodies import reading_to_the_end

if environment.PROCESS != "web":
    # It would sign sessions and receipts with a key that ends with it.
    raise ImproperlyConfigured(
        f"TSTTC_PROCESS is {environment.PROCESS!r}; expected 'web', which alone has the keys to serve pages."
    )
os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")

application = reading_to_the_end(get_wsgi_application())
