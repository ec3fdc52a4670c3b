"""Is the web process of this container alive? Asks it under its own name, as a visitor would."""

import os
import sys
import urllib.error
import urllib.request

# gunicorn listens on every address of the container, this one among them.
port = os.environ.get("TSTTC_WEB_BIND", ":8000").rpartition(":")[2]
address = f"127.0.0.1:{port}"
request = urllib.request.Request(
    f"http://{address}/healthz",
    headers={"Host": os.environ["TSTTC_ALLOWED_HOSTS"].split(",")[0], "X-Forwarded-Proto": "https"},
)
# No proxy that the environment names lies between a process and itself.
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
try:
    with opener.open(request, timeout=5) as answer:
        sys.exit(answer.status != 200)
except urllib.error.URLError as fault:
    sys.exit(f"{address}/healthz: {fault}")
