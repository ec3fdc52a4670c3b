"""Files that the site has lost for good: once a maintainer says so, a backup without them is a good one."""

import tempfile
from collections.abc import Collection, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

import structlog
from django.db import transaction

from leaderboard import audit
from leaderboard.backups import contents, copies
from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import LostFile
from leaderboard.storage import seeds

log = structlog.get_logger(__name__)

MAX_REASON: Final = 500


def acknowledge(names: Sequence[str], *, reason: str, now: datetime) -> dict[str, str]:
    """Note that these files are lost for good, all or none. Returns what is wrong with each.

    Raises `Refused` for a file that the site does not need, or that is undamaged.
    """
    reason = clean_text("reason", reason, limit=MAX_REASON)
    faults = {name: _fault_of(name, now=now) for name in names}
    with transaction.atomic():
        for name, fault in faults.items():
            LostFile.objects.update_or_create(name=name, defaults={"reason": reason, "noted_at": now})
            audit.record(
                verb="acknowledged",
                noun="LostFile",
                noun_id=Path(name).name[:80],
                details={"file": name, "fault": fault, "reason": reason},
            )
    return faults


def acknowledged() -> set[str]:
    return set(LostFile.objects.values_list("name", flat=True))


def forget_all_but(names: Collection[str]) -> None:
    """Forget files that are there again, or that nothing needs any more: lost once more, they are news."""
    found = LostFile.objects.exclude(name__in=names)
    for name in found.values_list("name", flat=True):
        log.info("lost_file_is_back", file=name)
    found.delete()


def _fault_of(name: str, *, now: datetime) -> str:
    folder, _, own_name = name.partition("/")
    private = {path.name: path for path in contents.needed_private_files()}
    with tempfile.TemporaryDirectory() as place:
        if name in contents.named_files()[0]:
            copy = copies.keep_stored(Path(place), name, former="", reader=copies.StoreReader())
        elif folder == contents.GROUND_TRUTH and own_name in private:
            copy = copies.keep_private(Path(place), private[own_name], former="", now=now)
        else:
            raise Refused(
                "bad-value",
                f"The site needs no file {name[:120]!r}; expected one that `backup` has named, such as "
                "predictions/0a/….json.",
            )
    if not copy.fault:
        raise Refused("bad-value", f"The file {name} is there and undamaged, so nothing was changed.")
    if own_name == seeds.path().name:
        raise Refused("bad-value", f"{name} can be made again; expected `make_seed_key`.")
    return copy.fault
