"""Files of an earlier edition, whose anno_ids mean other sequences now, and the command that repairs them."""

import json
from pathlib import Path

import pytest

from evaluator import GroundTruth, Rejected, evaluate, read_predictions, write_predictions
from evaluator.predictions import former
from evaluator.predictions.conversion import convert
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import Tsttc, envelope, flat, make_truth


def without_a_recording(truth: GroundTruth, recording: str) -> GroundTruth:
    """The next edition: without this recording, and numbered again."""
    rows = [row for row, name in enumerate(truth.manifest.bag_stamp) if name != recording]
    table = truth.subset(rows).to_table()
    table.anno_id = list(range(len(rows)))
    return GroundTruth.from_table(table)


FIRST = make_truth([1.0 + 0.25 * row for row in range(16)])
SECOND = without_a_recording(FIRST, "0001")
BY_NUMBER = write_predictions(manifest=FIRST.manifest, ttc_s=FIRST.ttc_s, keys="anno_id")


@pytest.mark.parametrize(
    "data",
    [
        BY_NUMBER,
        write_predictions(manifest=FIRST.manifest, ttc_s=FIRST.ttc_s, keys="anno_id", meta={"epoch": 3}),
        b"anno_id,ttc\n"
        + b"".join(b"%d,%r\n" % (row, value) for row, value in enumerate(FIRST.ttc_s.tolist())),
    ],
)
def test_a_file_of_the_first_edition_is_repaired_for_the_second(data: bytes) -> None:
    with pytest.raises(Rejected):
        read_predictions(data, manifest=SECOND.manifest)
    repaired = convert(data, manifest=FIRST.manifest, to_manifest=SECOND.manifest)
    report = evaluate(read_predictions(repaired, manifest=SECOND.manifest), SECOND)
    assert report.scores["overall"].rte == 0


def test_scale_ratios_keep_their_own_rates_under_natural_keys() -> None:
    ratios = {str(row): 0.9 for row in range(16)}
    rates = {str(row): 2.0 + row for row in range(16)}
    old = envelope(ratios, unit="scale_ratio", fps=rates)
    new = convert(old, manifest=FIRST.manifest)
    assert list(json.loads(new)) == list(FIRST.manifest.natural_keys)
    before = read_predictions(old, manifest=FIRST.manifest).ttc_s
    assert read_predictions(new, manifest=FIRST.manifest).ttc_s.tolist() == before.tolist()


def problems(data: bytes, **manifests: object) -> list[str]:
    with pytest.raises(Rejected) as rejected:
        convert(data, **manifests)  # type: ignore[arg-type]
    return [f"{problem.code}: {problem.message}" for problem in rejected.value.problems]


def test_a_file_that_does_not_fit_the_manifest_is_not_converted() -> None:
    short = flat({str(row): 1.0 for row in range(12)})
    assert problems(short, manifest=FIRST.manifest) == [
        "missing-keys: The file has 12 anno_ids and the manifest 16 sequences; no value for 4 of the "
        "sequences: 12, 13, 14, 15; expected one for each, and the manifest for which the file was made."
    ]
    assert problems(BY_NUMBER, manifest=SECOND.manifest) == [
        "unknown-keys: The file has 16 anno_ids and the manifest 12 sequences; no sequence for 4 of the "
        'anno_ids: "12", "13", "14", "15"; expected the anno_ids 0 to 11.'
    ]
    [message] = problems(BY_NUMBER, to_manifest=SECOND.manifest)
    assert message.startswith("unknown-keys: None of the 16 keys is a natural key of the manifest, such as ")


def test_natural_keys_lose_only_the_sequences_that_are_gone() -> None:
    natural = write_predictions(manifest=FIRST.manifest, ttc_s=FIRST.ttc_s)
    kept = convert(natural, to_manifest=SECOND.manifest)
    assert read_predictions(kept, manifest=SECOND.manifest).ttc_s.tolist() == SECOND.ttc_s.tolist()


def test_the_command_repairs_a_file_of_an_earlier_edition(tsttc: Tsttc, tmp_path: Path) -> None:
    old, new, mine = tmp_path / "old.csv", tmp_path / "new.csv", tmp_path / "mine.json"
    old.write_bytes(FIRST.manifest.to_csv())
    new.write_bytes(SECOND.manifest.to_csv())
    (tmp_path / "sent.json").write_bytes(BY_NUMBER)
    done = tsttc("convert", tmp_path / "sent.json", "--manifest", old, "--to-manifest", new, "-o", mine)
    assert done.stdout == f"{mine}: seconds by natural key, only for the sequences of {new}.\n"
    assert tsttc("check", mine, "--manifest", new).exit_code == 0
    both = tsttc("convert", tmp_path / "sent.json", "--manifest", old, "--annotations", tmp_path)
    assert (both.exit_code, "Give either --annotations or --manifest" in both.stderr) == (2, True)


def test_submit_says_which_edition_a_file_fits_in_the_words_of_the_server(
    tsttc: Tsttc, site: RecordedSite, at_site: None, tmp_path: Path
) -> None:
    def csv(truth: GroundTruth) -> Reply:
        return Reply(truth.manifest.to_csv(), headers={"Content-Type": "text/csv"})

    editions = [
        {"edition": number, "manifest": truth.manifest.digest} for number, truth in ((1, FIRST), (2, SECOND))
    ]
    site.put("GET /api/v1/splits/val/editions", Reply(editions))
    site.put("GET /api/v1/splits/val/manifest", csv(SECOND), csv(FIRST))
    mine = tmp_path / "mine.json"
    mine.write_bytes(BY_NUMBER)
    refused = tsttc("submit", mine, "--split", "val", "--method", "Foo++")
    assert refused.exit_code == 1
    assert former.advice(split="val", edition=1, keys="anno_id") in refused.stderr
    assert site.posts == []


def test_submit_says_which_other_split_a_file_fits(
    tsttc: Tsttc, site: RecordedSite, at_site: None, tmp_path: Path
) -> None:
    def csv(truth: GroundTruth) -> Reply:
        return Reply(truth.manifest.to_csv(), headers={"Content-Type": "text/csv"})

    site.put("GET /api/v1/splits", Reply([{"split": name} for name in ("val", "empty", "test")]))
    site.put("GET /api/v1/splits/val/editions", Reply([{"edition": 1, "manifest": SECOND.manifest.digest}]))
    site.put("GET /api/v1/splits/val/manifest", csv(SECOND))
    site.put("GET /api/v1/splits/test/manifest", csv(FIRST))
    mine = tmp_path / "mine.json"
    mine.write_bytes(BY_NUMBER)
    refused = tsttc("submit", mine, "--split", "val", "--method", "Foo++")
    assert refused.exit_code == 1
    assert 'The file fits the split "test", and was sent to "val".' in refused.stderr
    assert site.posts == []
