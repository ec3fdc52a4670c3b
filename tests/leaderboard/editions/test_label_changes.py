"""A correction can be looked at before anything is kept, and manifests of earlier editions stay to be had."""

import csv
import stat
from io import StringIO
from pathlib import Path

import pytest
from django.conf import settings as configured
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone

from leaderboard.editions import ground_truth
from leaderboard.models import AuditEvent, Edition, GroundTruth, Publication
from tests import builders

pytestmark = pytest.mark.django_db

MANIFEST = "/api/v1/splits/test/manifest"


def csv_of(client: Client, query: dict[str, str]) -> bytes:
    response = client.get(MANIFEST, query)
    assert response.status_code == 200
    return response.getvalue()


def test_a_dry_run_says_what_would_change_and_keeps_nothing(edition: Edition, tmp_path: Path) -> None:
    lines = builders.truth_csv(tmp_path / "new.csv").read_text().splitlines()
    # The first label changes its sign, the last sequence goes, and one comes.
    first, last = lines[1].split(","), lines.pop()
    lines[1] = ",".join([*first[:-1], "-1.5"])
    lines.append(",".join([last.split(",")[0], "9999", *last.split(",")[2:]]))
    (tmp_path / "new.csv").write_text("\n".join(lines) + "\n")
    n_events = AuditEvent.objects.count()
    kept = sorted(configured.GROUND_TRUTH_DIR.iterdir())
    out = StringIO()
    call_command(
        "open_edition",
        "test",
        truth=tmp_path / "new.csv",
        dry_run=True,
        diff=tmp_path / "diff.csv",
        stdout=out,
    )
    assert "1 sequence added, 1 removed, 1 changed" in out.getvalue()
    assert "Nothing was kept." in out.getvalue()
    # It has values of the ground truth.
    assert stat.S_IMODE((tmp_path / "diff.csv").stat().st_mode) == 0o600
    with (tmp_path / "diff.csv").open(newline="") as file:
        rows = {row["recording"]: row for row in csv.DictReader(file)}
    assert len(rows) == 3
    changed = rows[first[1]]
    assert (changed["n_changed"], changed["n_sign_changed"], changed["largest_change_s"]) == ("1", "1", "2.5")
    assert rows["9999"]["n_added"] == "1"
    assert (GroundTruth.objects.count(), Edition.objects.count()) == (1, 1)
    assert AuditEvent.objects.count() == n_events
    assert sorted(configured.GROUND_TRUTH_DIR.iterdir()) == kept


def test_a_diff_without_a_dry_run_or_a_published_edition_is_refused(edition: Edition, tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="--diff needs --dry-run"):
        call_command("open_edition", "test", truth=tmp_path / "any.csv", diff=tmp_path / "diff.csv")
    with pytest.raises(CommandError, match="no published edition to compare with"):
        call_command("open_edition", "val", dry_run=True, truth=tmp_path / "any.csv")


def test_the_manifest_of_a_former_edition_stays_to_be_had(rescored: Edition, client: Client) -> None:
    address = MANIFEST
    assert client.get(address, {"edition": "2"}).status_code == 404  # it was never the board
    first = csv_of(client, {"edition": "1"})
    assert first == csv_of(client, {})
    ground_truth.make_board(
        edition=rescored, kind=Publication.Kind.PUBLISHED, reason="R", now=timezone.now(), actor=None
    )
    assert csv_of(client, {"edition": "1"}) == first
    assert csv_of(client, {"edition": "2"}) == first  # only labels changed
    for text in ("3", "x", "²", "9" * 30):
        assert client.get(address, {"edition": text}).status_code == 404
    assert f"{address}?edition=1" in client.get("/board/test/editions/1/").content.decode()
