"""The toolkit numbers a folder as the file system lists it: we warn of that, and natural keys repair it."""

import json
import shlex
from pathlib import Path

import pytest

from evaluator import Rejected, evaluate, read_manifest, read_predictions, read_truth
from evaluator.predictions.conversion import convert
from evaluator.truth.numbering import read_numbering
from tests.evaluator.toolkit_folders import driving_folder, list_backwards, toolkit_results
from tests.evaluator.worlds import Tsttc, flat


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Annotations on a machine that lists them backwards."""
    list_backwards(monkeypatch)
    return driving_folder(tmp_path / "my annotations")


@pytest.fixture
def results(folder: Path, tmp_path: Path) -> Path:
    """The toolkit's result file of this folder."""
    path = tmp_path / "results.json"
    path.write_bytes(flat({anno_id: ttc_s for anno_id, (_, ttc_s) in toolkit_results(folder).items()}))
    return path


@pytest.mark.slow
def test_numbers_are_those_of_the_toolkit_in_whatever_order_files_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = driving_folder(tmp_path / "here")
    for _ in range(2):
        keys = {anno_id: key for anno_id, (key, _) in toolkit_results(folder).items()}
        assert read_numbering(folder).natural_keys == keys
        list_backwards(monkeypatch)


@pytest.mark.slow
def test_sequences_that_change_their_number_are_counted(folder: Path) -> None:
    numbering = read_numbering(folder)
    keys = read_manifest(folder).natural_keys
    differing = [i for i, key in enumerate(keys) if numbering.natural_keys[str(i)] != key]
    assert numbering.n_renumbered == len(differing) > 300


@pytest.mark.slow
def test_results_of_the_toolkit_score_what_they_are_worth_once_they_have_natural_keys(
    tsttc: Tsttc, folder: Path, results: Path, tmp_path: Path
) -> None:
    truth = read_truth(folder)
    worth = evaluate(read_predictions(results.read_bytes(), manifest=truth.manifest), truth)
    converted = tmp_path / "natural.json"
    made = tsttc("convert", results, "--annotations", folder, "-o", converted)
    assert (made.exit_code, made.stdout) == (0, f"{converted}: seconds by natural key.\n")
    document = json.loads(tsttc("score", converted, "--truth", folder, "--json").stdout)
    assert document["scores"]["overall"]["rte"] == pytest.approx(2.0)
    assert document["warnings"] == []
    assert worth.scores["overall"].rte is not None
    assert worth.scores["overall"].rte > 20


@pytest.mark.slow
def test_check_warns_of_the_toolkit_s_numbers_with_the_command_that_mends_them(
    tsttc: Tsttc, folder: Path, results: Path
) -> None:
    checked = tsttc("check", results, "--annotations", folder)
    n_renumbered = read_numbering(folder).n_renumbered
    assert checked.exit_code == 0
    assert checked.stdout == (
        f"{results} is well-formed: 327 sequences, each predicted once.\n"
        f"The toolkit numbers {n_renumbered} of the 327 sequences of the folder differently "
        "from the manifest: the order of files is another one.\n"
    )
    shuffled, numbering = checked.stderr.splitlines()
    assert shuffled.startswith("Warning: The predictions seem to be in another order than the sequences. ")
    assert "The values are smooth in the toolkit's numbering only, so the toolkit wrote" in numbering
    command = shlex.split(numbering[numbering.index("tsttc convert") :])
    assert command == ["tsttc", "convert", str(results), "--annotations", str(folder), "-o", "natural.json"]
    document = json.loads(tsttc("check", results, "--annotations", folder, "--json").stdout)
    assert [warning["code"] for warning in document["warnings"]] == ["shuffled-values", "other-numbering"]
    assert document["n_renumbered"] == n_renumbered


@pytest.mark.slow
def test_manifest_of_a_folder_says_how_the_toolkit_numbers_it(tsttc: Tsttc, folder: Path) -> None:
    n_renumbered = read_numbering(folder).n_renumbered
    made = tsttc("manifest", folder)
    assert made.stderr.startswith(f"The toolkit numbers {n_renumbered} of the 327 sequences")
    assert json.loads(tsttc("manifest", folder, "--json").stdout)["n_renumbered"] == n_renumbered


@pytest.mark.slow
def test_order_is_checked_against_the_split_s_manifest(tsttc: Tsttc, folder: Path, tmp_path: Path) -> None:
    manifest = tmp_path / "manifest.csv"
    manifest.write_bytes(read_manifest(folder).to_csv())
    lines = manifest.read_text().splitlines(keepends=True)
    both = ("--manifest", manifest, "--annotations", folder)
    manifest.write_text("".join(lines))
    results = tmp_path / "mine.json"
    results.write_bytes(flat(read_truth(folder).ttc_s.tolist()))
    assert tsttc("check", results, *both).exit_code == 0
    manifest.write_text("".join([*lines[:-2], lines[-1].replace("bag7", "bag9")]))
    refused = tsttc("check", results, *both)
    assert refused.exit_code == 1
    assert "The folder lacks sequences of the manifest (1): bag9/" in refused.stderr
    assert "The folder has sequences that the manifest lacks (2): bag7/" in refused.stderr


# --- what cannot be converted ---------------------------------------------------------------------------


def messages(data: bytes, folder: Path) -> list[str]:
    with pytest.raises(Rejected) as rejected:
        convert(data, natural_keys=read_numbering(folder).natural_keys)
    return [f"{problem.code}: {problem.message}" for problem in rejected.value.problems]


@pytest.mark.slow
def test_results_of_another_folder_are_refused_with_both_numbers(folder: Path) -> None:
    assert messages(flat({str(i): 1.0 for i in range(326)}), folder) == [
        "missing-keys: The file has 326 anno_ids and the folder 327 sequences; no value for 1 of the "
        "sequences: 326; expected one for each, from the folder that the toolkit has read."
    ]
    assert messages(flat({str(i): 1.0 for i in range(328)}), folder) == [
        "unknown-keys: The file has 328 anno_ids and the folder 327 sequences; no sequence for 1 of the "
        'anno_ids: "327"; expected the anno_ids 0 to 326.'
    ]


@pytest.mark.slow
def test_natural_keys_are_not_converted_again(folder: Path, results: Path) -> None:
    once = convert(results.read_bytes(), natural_keys=read_numbering(folder).natural_keys)
    assert messages(once, folder) == [
        "unknown-keys: The 327 keys are natural keys already; expected anno_ids of the toolkit. The file "
        "needs no conversion of its keys."
    ]
