"""Settings from the environment, and the private folder and keys of a checkout.

Imported by `leaderboard/settings.py` alone, before Django is configured.
"""

import difflib
import os
import stat
from collections.abc import Callable, Collection, Iterable
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Any, Final

import environ
from django.core.exceptions import ImproperlyConfigured

FAULTS: list[str] = []
"""What is wrong with the variables, as sentences: all of it is said at once, by `require_sound`."""
ASKED: set[str] = set()
"""The variables that somebody reads."""
# What others read: gunicorn, the proxy, the command `tsttc` and the tests. Each is named without its prefix.
_OF_OTHERS: Final = frozenset(
    {
        "WEB_BIND",
        "WEB_THREADS",
        "SITE_HOST",
        "MAX_REQUEST_SIZE",
        "URL",
        "TOKEN",
        "TOKEN_FILE",
        "REQUIRE_SERVICES",
        "SHARED_DATA",
        "DATABASE_ALONE",
        "SCHEMATHESIS",
    }
)
_PREFIX: Final = "TSTTC_"


class Environment(environ.Env):
    """The variables. An empty one counts as absent; a malformed one is in `FAULTS` and has its default."""

    def get_value(self, var: str, cast: Any = None, default: Any = environ.Env.NOTSET, **options: Any) -> Any:
        ASKED.add(var)
        if not os.environ.get(var):
            return default
        try:
            return super().get_value(var, cast=cast, default=default, **options)
        except (ValueError, TypeError, ImproperlyConfigured):
            kind = getattr(cast, "__name__", "value")
            expected = {"int": "a whole number", "float": "a number", "bool": "0 or 1"}.get(kind, f"a {kind}")
            FAULTS.append(f"{var} is {os.environ[var]!r}; expected {expected}.")
            return default


def database(text: str) -> dict[str, Any]:
    """Return Django's settings of a database from its URL."""
    return _parsed("TSTTC_DATABASE_URL", text, env.db_url_config, "postgres://user:password@host:5432/name")


def mail_server(text: str) -> dict[str, Any]:
    """Return Django's settings of a mail server from its URL."""
    return _parsed("TSTTC_EMAIL_URL", text, env.email_url_config, "smtp+tls://user:password@host:587")


def networks(name: str, *, default: list[str]) -> list[IPv4Network | IPv6Network]:
    """Parse the networks of a variable."""
    parsed = []
    for text in env.list(name, default=default):
        try:
            parsed.append(ip_network(text.strip()))
        except ValueError:
            FAULTS.append(f"{name} has {text!r}; expected networks such as 10.0.0.0/8, separated by commas.")
    return parsed


def providers(**known: tuple[str, str, str]) -> dict[str, dict[str, Any]]:
    """Return allauth's settings of the providers whose client is set."""
    configured = {}
    for provider, (name, id_variable, secret_variable) in known.items():
        client_id, secret = (env.str(variable, default="") for variable in (id_variable, secret_variable))
        if bool(client_id) != bool(secret):
            missing = secret_variable if client_id else id_variable
            given = id_variable if client_id else secret_variable
            FAULTS.append(f"{missing} is not set, and {given} is; expected both or none.")
        if client_id and secret:
            configured[provider] = {
                "APP": {"name": name, "client_id": client_id, "secret": secret},
                # A code that somebody intercepts is worth nothing without what this site kept (RFC 7636).
                "OAUTH_PKCE_ENABLED": True,
            }
    return configured


def _parsed(name: str, text: str, parse: Callable[[str], dict[str, Any]], example: str) -> dict[str, Any]:
    try:
        parsed = parse(text) if text else {}
    except (ValueError, KeyError, LookupError, ImproperlyConfigured):
        parsed = {}
    is_nowhere = "smtp" in parsed.get("EMAIL_BACKEND", "") and not parsed["EMAIL_HOST"]
    if text and (is_nowhere or not parsed.get("ENGINE", parsed.get("EMAIL_BACKEND"))):
        # Without the text: it may have a password.
        FAULTS.append(f"{name} is not understood; expected an address such as {example}.")
    return parsed


def misspelt(names: Iterable[str]) -> list[str]:
    """Return a sentence for each `TSTTC_…` that is never read, with a similar name."""
    known = ASKED | {_PREFIX + name for name in _OF_OTHERS}
    sentences = []
    for name in sorted(names):
        if name.startswith(_PREFIX) and name not in known and not name.startswith(f"{_PREFIX}TEST_"):
            near = difflib.get_close_matches(name, known, n=1)
            sentences.append(f"{name} is read by nothing" + (f"; did you mean {near[0]}?" if near else "."))
    return sentences


def require_sound() -> None:
    """Report every fault of the variables, and names that are never read. Raises `ImproperlyConfigured`."""
    if FAULTS:
        # Django may read the settings twice; each fault is said once.
        raise ImproperlyConfigured("\n".join([*dict.fromkeys(FAULTS), *misspelt(os.environ)]))


env = Environment()

PROFILE: str = env.str("TSTTC_PROFILE", default="embedded")
if PROFILE not in {"embedded", "production"}:
    raise ImproperlyConfigured(f"TSTTC_PROFILE is {PROFILE!r}; expected 'embedded' or 'production'.")
PRODUCTION = PROFILE == "production"

# Which process this is, so that none has to be given a secret that it has no use for.
PROCESSES = ("web", "worker", "migrate", "maintainer", "mailer", "backup")
PROCESS: str = env.str("TSTTC_PROCESS", default="web")
if PROCESS not in PROCESSES:
    raise ImproperlyConfigured(f"TSTTC_PROCESS is {PROCESS!r}; expected one of {', '.join(PROCESSES)}.")


def required(name: str, *, embedded: Any, by: Collection[str] = PROCESSES, elsewhere: Any = "") -> Any:
    """Return the variable; it is required in the processes `by` of production.

    Their default is an error, that of other processes `elsewhere`, outside production `embedded`.
    """
    if not PRODUCTION:
        return env.str(name, default=embedded)
    if PROCESS in by and not env.str(name, default=""):
        FAULTS.append(f"{name} is not set. In production it has no default; docs/settings.md describes it.")
    return env.str(name, default="") or elsewhere


def make_private(folder: Path) -> None:
    """Make a folder private to its owner; leave one of another user, or a shared one such as /tmp."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    status = folder.stat()
    is_shared = status.st_uid != os.geteuid() or status.st_mode & stat.S_ISVTX
    if not is_shared and stat.S_IMODE(status.st_mode) & 0o077:
        folder.chmod(0o700)


def key_of_checkout(path: Path, make: Callable[[], str]) -> str:
    """Return a key of this checkout, made once, so that a restart of the demo keeps signatures.

    In production, where only the web process is given keys, it is random.
    """
    if PRODUCTION:
        return make()
    if not path.exists():
        path.touch(mode=0o600)
        path.write_text(make())
    return path.read_text()
