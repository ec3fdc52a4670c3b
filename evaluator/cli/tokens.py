"""The token: from the environment, or from the keyring of the operating system. Never shown, never an option.

`keyring` is imported where it is needed: it costs more time than the rest of a command.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.cli.options import TOKEN_VARIABLE

if TYPE_CHECKING:
    from keyring.backend import KeyringBackend

SERVICE = "tsttc"  # under which the keyring files the tokens; the account is the server's address


def token_for(url: str) -> str:
    """The token for the leaderboard at `url`: that of the environment, else that of `tsttc login`."""
    value = os.environ.get(TOKEN_VARIABLE)
    if value is not None:
        return checked(value, named=TOKEN_VARIABLE)
    kept = kept_token(url)
    if kept is None:
        raise _no_token(
            f"There is no token: {TOKEN_VARIABLE} is not set, and tsttc login has saved none.", url
        )
    return kept


def has_token(url: str) -> bool:
    """Whether there is a token, for commands that can do without."""
    return bool(os.environ.get(TOKEN_VARIABLE, "").strip()) or kept_token(url) is not None


def checked(text: str, *, named: str) -> str:
    """The token that `text` is; raises Failure for one that cannot be sent."""
    value = text.strip()
    if not value:
        raise Failure(
            f"{named} is empty; expected a token.",
            exit_code=Exit.AUTH,
            code="no-token",
            hint="In a CI job, check that the secret is available for this branch.",
        )
    if not value.isascii() or not value.isprintable() or " " in value:
        raise Failure(
            f"{named} is not a token: it contains invalid characters.",
            exit_code=Exit.AUTH,
            code="no-token",
        )
    return value


def _no_token(words: str, url: str) -> Failure:
    return Failure(
        words,
        exit_code=Exit.AUTH,
        code="no-token",
        hint=f"Create one at {url.rstrip('/')}/tokens/, then: tsttc login, or export {TOKEN_VARIABLE}=…",
    )


def kept_token(url: str) -> str | None:
    """What the keyring has for `url`; None also where there is no keyring, or it stays locked."""
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    backend = usable_keyring()
    if backend is None:
        return None
    try:
        return backend.get_password(SERVICE, account(url))
    except (KeyringError, OSError):
        return None


def keep_token(url: str, token: str) -> str:
    """Put the token into the keyring; gives the keyring's name."""
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    backend = required_keyring()
    try:
        backend.set_password(SERVICE, account(url), token)
    except (KeyringError, OSError) as error:
        raise no_keyring(f"The keyring did not accept the token ({error or type(error).__name__}).") from None
    return backend.name


def forget_token(url: str) -> bool:
    """Remove the token from the keyring; whether there was one."""
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    backend = usable_keyring()
    if backend is None or kept_token(url) is None:
        return False
    try:
        backend.delete_password(SERVICE, account(url))
    except (KeyringError, OSError) as error:
        raise no_keyring(f"The keyring did not delete the token ({error or type(error).__name__}).") from None
    return True


def required_keyring() -> KeyringBackend:
    """The keyring; raises Failure with what to do on a machine without one."""
    backend = usable_keyring()
    if backend is None:
        raise no_keyring("This machine has no keyring, as is usual without a desktop.")
    return backend


def usable_keyring() -> KeyringBackend | None:
    """The operating system's keyring, if there is one that keeps anything."""
    import keyring  # noqa: PLC0415 -- as the module says

    try:
        backend = keyring.get_keyring()
    except (ImportError, OSError, ValueError, RuntimeError):  # a backend that is named but not there
        return None
    # What keyring falls back on: one that always fails (0), and one that forgets everything (-1).
    return backend if backend.priority > 0 else None


def no_keyring(words: str) -> Failure:
    """The failure for a keyring that is not there, or does not do its work."""
    return Failure(
        words,
        exit_code=Exit.AUTH,
        code="no-keyring",
        hint=f"Use the environment: export {TOKEN_VARIABLE}=… in your shell, or a secret of the CI job.",
    )


def account(url: str) -> str:
    """The name of a server in the keyring, the same however its address is spelt."""
    return url.rstrip("/").lower()
