"""Sessions in the database: end those of an account, and forget addresses that are in others."""

import re
from collections.abc import Collection
from importlib import import_module
from typing import Any
from urllib.parse import unquote_plus

from allauth.account.utils import user_pk_to_url_str
from django.conf import settings
from django.contrib.auth import SESSION_KEY
from django.contrib.sessions.models import Session

from leaderboard.models import User

# What a sign-in or a sign-up that is not finished keeps.
_PENDING = ("account_login", "account_email_verification_code")


def end_all(*, user: User, addresses: Collection[str] = ()) -> int:
    """End every session of an account, also those that are still signing in to it. Returns how many.

    Every other session loses what it holds of these addresses.
    """
    patterns = [_pattern(address) for address in addresses if address]
    n_ended = 0
    for session in Session.objects.iterator(chunk_size=500):
        data = session.get_decoded()
        hits = {key for key, value in data.items() if any(_holds(value, each) for each in patterns)}
        if data.get(SESSION_KEY) == str(user.pk) or _is_entering(data, user):
            session.delete()
            n_ended += 1
        elif hits:
            kept = {key: value for key, value in data.items() if key not in hits}
            Session.objects.save(session.session_key, kept, session.expire_date)
    return n_ended


def clear_expired() -> None:
    import_module(settings.SESSION_ENGINE).SessionStore.clear_expired()


def _is_entering(data: dict[str, Any], user: User) -> bool:
    login, code = (data.get(key) or {} for key in _PENDING)
    return login.get("user_pk") == user_pk_to_url_str(user) or code.get("user_id") == str(user.pk)


def _pattern(address: str) -> re.Pattern[str]:
    # Not where it is only a part of another address.
    return re.compile(rf"(?<![\w.+-]){re.escape(address)}(?![\w-])", re.IGNORECASE)


def _holds(value: Any, pattern: re.Pattern[str]) -> bool:
    if isinstance(value, str):
        # Forms that wait for a password are kept as they were sent.
        return bool(pattern.search(value) or pattern.search(unquote_plus(value)))
    if isinstance(value, dict):
        return any(_holds(each, pattern) for each in (*value, *value.values()))
    return isinstance(value, list) and any(_holds(each, pattern) for each in value)
