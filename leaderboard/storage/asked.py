"""The file of a question, for a browser without a script, which forgets it: one of each account, for an hour.

It counts for no quota and is no submission. A later question replaces it, so nobody can fill the store.
"""

from datetime import datetime, timedelta
from typing import Final

import structlog
from django.core.files.base import File
from django.utils.crypto import salted_hmac

from leaderboard.models import User
from leaderboard.storage import files, ownership

log = structlog.get_logger(__name__)

FOLDER: Final = "asked"
MAX_AGE: Final = timedelta(hours=1)


def keep(upload: "File[bytes]", *, user: User) -> bool:
    """Keep a file until its account answers, in place of an earlier one. False: the store did not take it."""
    upload.seek(0)
    try:
        files.store().save(name_for(user), upload)
    except OSError as fault:
        # The question can be answered all the same: with the file chosen again.
        log.warning("asked_file_not_kept", user_id=user.pk, reason=str(fault)[:200])
        return False
    return True


def kept(*, user: User, digest: str, now: datetime) -> "File[bytes] | None":
    """Open the file of this digest that is kept for an account; None for another file, or an old one.

    The caller closes it.
    """
    try:
        if files.store().get_modified_time(name_for(user)) < now - MAX_AGE:
            return None
        file: File[bytes] = files.store().open(name_for(user), "rb")
    except OSError:
        return None
    if files.measure(file).digest != digest:
        file.close()
        return None
    return file


def forget(*, user: User) -> None:
    """Remove what is kept for an account."""
    try:
        files.store().delete(name_for(user))
    except OSError as fault:
        log.warning("asked_file_stays", user_id=user.pk, reason=str(fault)[:200])


def remove_old(*, now: datetime) -> int:
    """Remove what was kept for more than `MAX_AGE`. Returns how many files. Raises `OSError`."""
    if not ownership.may_remove_files(now=now):
        return 0
    try:
        names = files.store().listdir(FOLDER)[1]
    except FileNotFoundError:
        return 0
    than = now - MAX_AGE
    return sum(files.store().delete_if_older(f"{FOLDER}/{name}", than) for name in names)  # type: ignore[attr-defined]  # both stores have it


def name_for(user: User) -> str:
    """Return the name of what is kept for an account."""
    # Of this site alone: a store that was copied with the site has accounts of the same numbers.
    return f"{FOLDER}/{salted_hmac(__name__, str(user.pk), algorithm='sha256').hexdigest()}"
