"""Is the web process of this container alive? Asks it under its own name, as a visitor would."""

import os
import sys
import urllib.error
import urllib.request

request = urllib.request.Request(
    "http://127.0.0.1:8000/healthz",
    headers={"Host": os.environ["TSTTC_ALLOWED_HOSTS"].split(",")[0], "X-Forwarded-Proto": "https"},
)
try:
    with urllib.request.urlopen(request, timeout=5) as answer:  # noqa: S310 - the address stands above
        sys.exit(answer.status != 200)
except urllib.error.URLError as fault:
    sys.exit(f"/healthz: {fault}")
