"""The token: from the environment, the keyring, or a file that only its owner can read."""

# `keyring` is imported late: it takes longer than the rest of a command.

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.cli.options import TOKEN_VARIABLE, tokens_page
from evaluator.cli.paths import settings_file
from evaluator.texts import text_of

if TYPE_CHECKING:
    from keyring.backend import KeyringBackend

TOKEN_FILE_VARIABLE: Final = "TSTTC_TOKEN_FILE"  # noqa: S105 -- the name of a variable
SERVICE = "tsttc"  # under which the keyring files the tokens; the account is the server's address


def token_for(url: str) -> str:
    """Return the token for `url`: from the environment, else from `tsttc login`."""
    value = os.environ.get(TOKEN_VARIABLE)
    if value is not None:
        return checked(value, named=TOKEN_VARIABLE)
    path = os.environ.get(TOKEN_FILE_VARIABLE)
    if path:
        return checked(_text_of(Path(path)), named=f"The file that {TOKEN_FILE_VARIABLE} names")
    kept = kept_token(url)
    if kept is None:
        raise _no_token(
            f"There is no token: {TOKEN_VARIABLE} is not set, and tsttc login has saved none.", url
        )
    return kept


def has_token(url: str) -> bool:
    is_named = os.environ.get(TOKEN_VARIABLE, "").strip() or os.environ.get(TOKEN_FILE_VARIABLE)
    return bool(is_named) or kept_token(url) is not None


def checked(text: str, *, named: str) -> str:
    value = text.strip().removeprefix("\ufeff")  # editors of Windows begin a file so
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
        hint=f"Create one at {tokens_page(url)}, then: tsttc login, or export {TOKEN_VARIABLE}=…",
    )


def kept_token(url: str) -> str | None:
    """Return the token for `url` from keyring or file; None also for a locked keyring."""
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    backend = usable_keyring()
    token = None
    if backend is not None:
        with suppress(KeyringError, OSError):
            token = backend.get_password(SERVICE, account(url))
    return token or _kept_in_file().get(account(url))


def keep_token(url: str, token: str) -> str:
    """Put the token into the keyring, else into the file; returns the name of the store."""
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    backend = usable_keyring()
    if backend is None:
        return _keep_in_file(_kept_in_file() | {account(url): token})
    try:
        backend.set_password(SERVICE, account(url), token)
    except (KeyringError, OSError) as error:
        raise no_keyring(f"The keyring did not accept the token ({error or type(error).__name__}).") from None
    return backend.name


def forget_token(url: str) -> bool:
    from keyring.errors import KeyringError  # noqa: PLC0415 -- as the module says

    if kept_token(url) is None:
        return False
    kept = _kept_in_file()
    was_in_file = kept.pop(account(url), None) is not None
    if was_in_file:
        _keep_in_file(kept)
    backend = usable_keyring()
    if backend is None or kept_token(url) is None:
        return was_in_file
    try:
        backend.delete_password(SERVICE, account(url))
    except (KeyringError, OSError) as error:
        raise no_keyring(f"The keyring did not delete the token ({error or type(error).__name__}).") from None
    return True


def usable_keyring() -> KeyringBackend | None:
    import keyring  # noqa: PLC0415 -- as the module says

    try:
        backend = keyring.get_keyring()
    except (ImportError, OSError, ValueError, RuntimeError):  # a backend that is named but not there
        return None
    # What keyring falls back on: one that always fails (0), and one that forgets everything (-1).
    return backend if backend.priority > 0 else None


def tokens_file() -> Path:
    return settings_file().with_name("tokens.json")


def _kept_in_file() -> dict[str, str]:
    try:
        tokens = json.loads(tokens_file().read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RuntimeError):  # no file, no JSON, no home directory
        return {}
    return {str(name): str(token) for name, token in tokens.items()} if isinstance(tokens, dict) else {}


def _keep_in_file(kept: dict[str, str]) -> str:
    """Write the file, readable for its owner only, or delete it without tokens; returns its name."""
    path = tokens_file()
    try:
        if not kept:
            path.unlink(missing_ok=True)
            return str(path)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = path.with_suffix(f".{os.getpid()}.part")
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            json.dump(kept, file, indent=2)
        part.replace(path)
    except OSError as error:
        raise no_keyring(f"There is no keyring, and {path} cannot be written ({error.strerror}).") from None
    # On Windows it has the rights of the user's own folder.
    owner = "" if sys.platform == "win32" else ", which only you can read"
    return f"{path}{owner}; this machine has no keyring"


def _text_of(path: Path) -> str:
    try:
        return text_of(path.read_bytes())
    except (OSError, UnicodeDecodeError) as error:
        cause = getattr(error, "strerror", None) or "it is not text"
        raise Failure(
            f"{TOKEN_FILE_VARIABLE} names {path}, which cannot be read: {cause}.",
            exit_code=Exit.AUTH,
            code="no-token",
        ) from None


def no_keyring(words: str) -> Failure:
    return Failure(
        words,
        exit_code=Exit.AUTH,
        code="no-keyring",
        hint=f"Use the environment: export {TOKEN_VARIABLE}=… in your shell, or a secret of the CI job.",
    )


def account(url: str) -> str:
    return url.rstrip("/").lower()
