"""Fills the `test` board of the database that the environment names with entries, and changes it."""

import sys
import tempfile
from pathlib import Path


def main() -> None:
    """Open the split with a made-up ground truth, and write the rows."""
    from leaderboard.models import User  # noqa: PLC0415
    from leaderboard.people import teams  # noqa: PLC0415 - Django is configured only now
    from tests import board_rows, builders  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        edition = builders.import_truth(Path(folder))
    user = User.objects.create_user("owner@example.org", "correct horse", name="Owls")
    teams.team_of(user=user)
    board_rows.fill(edition, n=int(sys.argv[1]), user=user)


def change() -> None:
    """Change one value that everybody sees: the next reader has to see it."""
    from django.db import transaction  # noqa: PLC0415 - needs Django, which is configured only now
    from django.db.models import F  # noqa: PLC0415

    from leaderboard import versions  # noqa: PLC0415
    from leaderboard.models import Score  # noqa: PLC0415

    with transaction.atomic():
        first = Score.objects.order_by("pk").values("pk")[:1]
        Score.objects.filter(pk__in=first).update(value=F("value") + 0.01)
        versions.changed("test")
