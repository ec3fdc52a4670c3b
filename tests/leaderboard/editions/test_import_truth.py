"""`ground_truth.import_truth` and its command."""

import re
import stat
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from django.conf import settings
from django.core.management import CommandError, call_command
from django.utils import timezone

from evaluator import Rejected, read_truth
from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, GroundTruth, Split
from leaderboard.storage import files, truth_values
from tests import builders

pytestmark = pytest.mark.usefixtures("benchmark")


def test_first_import_opens_and_publishes_edition_one(tmp_path: Path) -> None:
    edition = builders.import_truth(tmp_path)
    split = Split.objects.get(name="test")
    assert (edition.number, edition.protocol) == (1, "tsttc-1")
    assert split.current_edition == edition
    assert edition.published_at is not None
    assert edition.ground_truth.n_sequences == builders.N_SEQUENCES
    assert edition.ground_truth.counts["overall"] == builders.N_SEQUENCES
    assert edition.ground_truth.counts["out_of_range"] == 1
    assert set(AuditEvent.objects.values_list("verb", flat=True)) == {"imported", "opened", "published"}


@pytest.mark.parametrize(
    ("split", "protocol"), [("test", "tsttc-1"), ("val", "tsttc-2"), ("demo", "tsttc-2")]
)
def test_an_open_split_opens_under_the_protocol_with_the_warning_error(
    tmp_path: Path, split: str, protocol: str
) -> None:
    call_command("import_truth", split, str(builders.truth_csv(tmp_path / "t.csv")), stdout=StringIO())
    assert Edition.objects.get().protocol == protocol


def test_a_hidden_split_gets_no_metric_that_tells_more_of_its_values(tmp_path: Path) -> None:
    words = (
        "The ground truth of the split 'test' is hidden, and protocol 'tsttc-2' would tell more of it "
        "(Warning error) than a submission may; expected one of tsttc-1, toolkit."
    )
    path = str(builders.truth_csv(tmp_path / "t.csv"))
    with pytest.raises(CommandError, match=re.escape(words)):
        call_command("import_truth", "test", path, protocol="tsttc-2")
    assert not GroundTruth.objects.exists()
    builders.import_truth(tmp_path)
    with pytest.raises(CommandError, match=re.escape(words)):
        call_command("open_edition", "test", truth=Path(path), protocol="tsttc-2")
    assert Edition.objects.count() == 1


def test_values_are_kept_in_the_private_directory_for_their_owner_only(tmp_path: Path) -> None:
    edition = builders.import_truth(tmp_path)
    path = truth_values.values_path(edition.ground_truth_id)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert np.array_equal(
        truth_values.load(edition.ground_truth_id).ttc_s, read_truth(tmp_path / "truth-test.csv").ttc_s
    )


def test_public_manifest_has_every_column_but_the_time_to_contact(tmp_path: Path) -> None:
    edition = builders.import_truth(tmp_path)
    with files.store().open(files.manifest_name(edition.ground_truth.manifest_digest)) as kept:
        lines = kept.read().decode().splitlines()
    assert lines[0] == "anno_id,bag_stamp,cam_id,ts,track_id"
    assert len(lines) == 1 + builders.N_SEQUENCES


def test_same_truth_again_is_answered_with_the_edition_that_has_it(tmp_path: Path) -> None:
    first = builders.import_truth(tmp_path)
    assert builders.import_truth(tmp_path) == first
    assert Edition.objects.count() == 1


def test_other_truth_for_an_open_split_is_refused(tmp_path: Path) -> None:
    first = builders.import_truth(tmp_path)
    with pytest.raises(Refused, match="has test edition 1 with other ground truth"):
        builders.import_truth(tmp_path, seed=1)
    assert Split.objects.get(name="test").current_edition == first


def test_one_truth_belongs_to_one_split(tmp_path: Path) -> None:
    builders.import_truth(tmp_path, split="val", shift_ns=0)
    kept = sorted(settings.GROUND_TRUTH_DIR.iterdir())
    with pytest.raises(Refused, match="belongs to the split 'val' already"):
        builders.import_truth(tmp_path, split="test")
    assert not Edition.objects.filter(split="test").exists()
    # Else the mark of hidden values, which stays, would end the error analysis of the open split.
    assert sorted(settings.GROUND_TRUTH_DIR.iterdir()) == kept


def test_faulty_truth_is_refused_with_its_problems_and_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text("anno_id,bag_stamp,cam_id,ts,track_id,ttc\n0,a,1,5,1,nan\n0,a,1,5,1,2.0\n")
    with pytest.raises(Rejected) as caught:
        ground_truth.import_truth(split_name="test", path=path, now=timezone.now())
    assert {"duplicate-ids", "duplicate-natural-keys"} <= {problem.code for problem in caught.value.problems}
    assert not GroundTruth.objects.exists()
    assert not Path(truth_values.values_path("x")).parent.exists()


def test_command_says_what_it_imported(tmp_path: Path) -> None:
    out = StringIO()
    call_command("import_truth", "test", str(builders.truth_csv(tmp_path / "t.csv")), stdout=out)
    assert "test edition 1: 120 sequences in 24 recordings" in out.getvalue()
    with pytest.raises(CommandError, match="There is no split 'nope'"):
        call_command("import_truth", "nope", str(tmp_path / "t.csv"))
    with pytest.raises(CommandError, match="was refused; nothing was changed"):
        call_command("import_truth", "test", str(tmp_path / "absent.csv"))
