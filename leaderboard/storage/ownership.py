"""Whose the file store is: only the site that it belongs to may remove files, and not soon after a restore.

A restored database lacks what was sent after its backup: files that a newer database names look unused.
So a restore gives the database a new site id, and a store keeps the id of the site that it belongs to.
"""

import json
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

import structlog
from django.conf import settings
from django.core.files.base import ContentFile
from django.db.models import Max

from leaderboard import audit
from leaderboard.models import AuditEvent, Installation, User
from leaderboard.storage import files

log = structlog.get_logger(__name__)

NAME: Final = "site.json"
UNKNOWN: Final = "unknown"
_MAX_CHARACTERS: Final = 80


@dataclass(frozen=True)
class Owner:
    """What a store says: the id of its site, and the last audit event that this site had sealed."""

    site_id: str
    seal_number: int


def this_site() -> Installation:
    return Installation.objects.get_or_create(pk=Installation.THE_ONE)[0]


def may_remove_files(*, now: datetime) -> bool:
    """Tell whether this site may remove files of the store now; a new store becomes its own.

    Raises `OSError` of the store and the database's error.
    """
    # The store first: if it knows a later event than a database that is read afterwards, this is an old one.
    owner = _owner()
    site = this_site()
    seal_number = _last_seal_number()
    if owner is None and site.restored_at is None:
        _write(site, seal_number)
        owner = Owner(str(site.site_id), seal_number)
    if owner is not None and owner.site_id == str(site.site_id) and owner.seal_number > seal_number:
        log.warning("older_database", seal_number=seal_number, expected_seal_number=owner.seal_number)
        note_restore(now=now)
        site = this_site()
    if owner is None or owner.site_id != str(site.site_id):
        site.store_is_of = owner.site_id if owner else UNKNOWN
        site.save(update_fields=["store_is_of"])
        log.warning("store_of_another_site", site_id=str(site.site_id), store_is_of=site.store_is_of)
        return False
    if site.store_is_of:
        site.store_is_of = ""
        site.save(update_fields=["store_is_of"])
    if owner.seal_number != seal_number:
        _write(site, seal_number)
    return not is_kept_after_restore(site, now=now)


def is_kept_after_restore(site: Installation, *, now: datetime) -> bool:
    """Tell whether the restore is so recent that a newer database may still be wanted."""
    return site.restored_at is not None and now < kept_until(site.restored_at)


def kept_until(restored_at: datetime) -> datetime:
    return restored_at + timedelta(days=settings.KEEP_AFTER_RESTORE_D)


def note_restore(*, now: datetime) -> Installation:
    """Give this database, which is that of a backup, a site id of its own, and note the time."""
    site = this_site()
    site.site_id, site.restored_at, site.store_is_of = uuid.uuid4(), now, ""
    site.save()
    return site


def take_if_new(site: Installation, *, is_new: bool) -> str:
    """Take a new store after a restore. Returns whose it is otherwise, "" if ours. Raises `OSError`."""
    owner = _owner()
    if owner is None and is_new:
        _write(site, _last_seal_number())
        return ""
    site.store_is_of = owner.site_id if owner else UNKNOWN
    site.save(update_fields=["store_is_of"])
    return site.store_is_of


def claim(*, reason: str, actor: User | None = None) -> str:
    """Make the store this site's. Returns whose it was, "" if it was ours already. Raises `OSError`."""
    owner = _owner()
    site = this_site()
    if owner is not None and owner.site_id == str(site.site_id):
        return ""
    before = owner.site_id if owner else UNKNOWN
    audit.record(
        verb="claimed",
        noun="FileStore",
        noun_id=site.site_id,
        actor=actor,
        details={"reason": reason, "before": before},
    )
    _write(site, _last_seal_number())
    site.store_is_of = ""
    site.save(update_fields=["store_is_of"])
    return before


def _last_seal_number() -> int:
    number: int | None = AuditEvent.objects.aggregate(last=Max("seal_number"))["last"]
    return number or 0


def _owner() -> Owner | None:
    """Read whose the store is; None if it does not say. Raises `OSError`."""
    try:
        with files.store().open(NAME, "rb") as file:
            document: Any = json.load(file)
    except FileNotFoundError:
        return None
    except ValueError:
        return Owner(UNKNOWN, 0)
    if not isinstance(document, dict) or not isinstance(document.get("seal_number"), int):
        return Owner(UNKNOWN, 0)
    return Owner(str(document.get("site_id"))[:_MAX_CHARACTERS], document["seal_number"])


def _write(site: Installation, seal_number: int) -> None:
    document = {
        "site_id": str(site.site_id),
        "seal_number": seal_number,
        "about": f"The site {settings.SITE_URL} removes unused files from this store; no other site does.",
    }
    files.store().save(NAME, ContentFile(json.dumps(document, indent=1).encode() + b"\n"))
