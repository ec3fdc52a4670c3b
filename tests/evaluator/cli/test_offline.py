"""check, score and manifest, as a person and as a program call them."""

from __future__ import annotations

import itertools
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from evaluator import Rejected, evaluate, read_predictions, read_truth
from evaluator.cli import own_commands
from tests.evaluator.worlds import EXAMPLES, REPOSITORY, Tsttc, process

GOOD = EXAMPLES / "predictions.json"
RATIOS = EXAMPLES / "predictions.scale_ratio.json"
BROKEN = EXAMPLES / "broken.json"
TRUTH = EXAMPLES / "truth.csv"
MANIFEST = EXAMPLES / "manifest.csv"
UNREADABLE = Path("/proc/self/mem")  # even for root, its first byte is not there to be read


def problems_of(path: Path) -> list[str]:
    """The library's refusal of a bad prediction file."""
    with pytest.raises(Rejected) as caught:
        read_predictions(path.read_bytes(), manifest=read_truth(TRUTH).manifest)
    return list(map(str, caught.value.problems))


@pytest.mark.parametrize("predictions", [GOOD, RATIOS])
@pytest.mark.parametrize("protocol", ["tsttc-1", "toolkit"])
def test_score_as_json_is_the_library_s_report_to_the_last_bit(
    tsttc: Tsttc, predictions: Path, protocol: str
) -> None:
    result = tsttc("score", predictions, "--truth", TRUTH, "--protocol", protocol, "--json")
    truth = read_truth(TRUTH)
    report = evaluate(
        read_predictions(predictions.read_bytes(), manifest=truth.manifest), truth, protocol=protocol
    )
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {**json.loads(report.to_json()), "warnings": []}
    assert result.stderr == ""


@pytest.mark.parametrize("command", ["check", "score"])
def test_predictions_may_come_from_standard_input(tsttc: Tsttc, command: str) -> None:
    table = ["--truth", TRUTH] if command == "score" else ["--manifest", MANIFEST]
    piped = tsttc(command, "-", *table, "--json", stdin=GOOD.read_bytes())
    assert piped.exit_code == 0
    assert json.loads(piped.stdout) == json.loads(tsttc(command, GOOD, *table, "--json").stdout)


@pytest.mark.parametrize(
    "arguments", [("check", BROKEN, "--manifest", MANIFEST), ("score", BROKEN, "--truth", TRUTH)]
)
def test_problems_are_numbered_in_the_library_s_words(tsttc: Tsttc, arguments: tuple[object, ...]) -> None:
    result = tsttc(*arguments)
    assert result.exit_code == 1
    assert result.stdout == ""
    assert (
        result.stderr.splitlines()[0] == f"Error: {BROKEN} is rejected: 7 problems; equal ones share a line"
    )
    numbered = [f"{number:>3}. {words}" for number, words in enumerate(problems_of(BROKEN), start=1)]
    assert result.stderr.splitlines()[1:] == numbered


def test_rejection_names_the_table_when_the_table_is_at_fault(tsttc: Tsttc, tmp_path: Path) -> None:
    table = tmp_path / "truth.csv"
    table.write_text("anno_id,ttc\n0,1\n")
    result = tsttc("score", GOOD, "--truth", table)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"Error: {table} is rejected: ")


def test_prediction_that_the_toolkit_cannot_score_is_the_file_s_fault(tsttc: Tsttc, tmp_path: Path) -> None:
    predictions = tmp_path / "near-zero.json"
    values = json.loads(GOOD.read_text())
    predictions.write_text(json.dumps(values | {next(iter(values)): -0.05}))
    result = tsttc("score", predictions, "--truth", TRUTH, "--protocol", "toolkit")
    assert result.exit_code == 1
    assert str(predictions) in result.stderr
    assert tsttc("score", predictions, "--truth", TRUTH).exit_code == 0


def test_file_name_cannot_steer_the_terminal(tsttc: Tsttc, tmp_path: Path) -> None:
    predictions = tmp_path / "a\x1b[2Jb.json"
    predictions.write_text("nonsense")
    result = tsttc("check", predictions, "--manifest", MANIFEST)
    assert result.exit_code == 1
    assert "\x1b" not in result.output


def test_manifest_is_the_truth_without_its_values(tsttc: Tsttc) -> None:
    result = tsttc("manifest", TRUTH)
    assert result.exit_code == 0
    assert result.stdout_bytes == MANIFEST.read_bytes()
    rows = TRUTH.read_text().splitlines()
    assert result.stdout.splitlines() == [row.rpartition(",")[0] for row in rows]


def test_manifest_can_be_written_to_a_file(tsttc: Tsttc, tmp_path: Path) -> None:
    written = tmp_path / "manifest.csv"
    result = tsttc("manifest", TRUTH, "-o", written)
    assert result.stdout == f"{written}: 60 sequences of 6 recordings.\n"
    assert written.read_bytes() == MANIFEST.read_bytes()
    described = json.loads(tsttc("manifest", TRUTH, "-o", written, "--json").stdout)
    assert (described["n_sequences"], described["n_recordings"]) == (60, 6)
    assert described["output"] == str(written)
    checked = json.loads(tsttc("check", GOOD, "--manifest", written, "--json").stdout)
    assert described["manifest_digest"] == checked["manifest_digest"]


def test_manifest_never_overwrites_the_truth(tsttc: Tsttc, tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    truth.write_bytes(TRUTH.read_bytes())
    result = tsttc("manifest", truth, "-o", tmp_path / "." / "truth.csv")
    assert result.exit_code == 2
    assert truth.read_bytes() == TRUTH.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "absent.json", "--manifest", MANIFEST], "'absent.json' does not exist"),
        (["check", EXAMPLES, "--manifest", MANIFEST], "is a directory"),
        (["check", GOOD], "Missing option '--manifest'"),
        (["check", GOOD, "--manifest", "absent.csv"], "'absent.csv' does not exist"),
        (["score", GOOD, "--truth", TRUTH, "--protocol", "tsttc-9"], "'tsttc-9' is not one of"),
        (["manifest", TRUTH, "-o", "absent/manifest.csv"], "cannot be written: No such file or directory"),
        (["mannifest"], "No such command 'mannifest'"),
        ([], "Usage: tsttc"),
    ],
)
def test_wrong_usage_is_explained_and_ends_with_2(tsttc: Tsttc, arguments: list[object], words: str) -> None:
    result = tsttc(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stdout == ""


@pytest.mark.skipif(not UNREADABLE.exists(), reason="this system has no file that exists but cannot be read")
def test_file_that_cannot_be_read_is_explained(tsttc: Tsttc) -> None:
    result = tsttc("check", UNREADABLE, "--manifest", MANIFEST)
    assert result.exit_code == 2
    assert f"{UNREADABLE} cannot be read: " in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", own_commands())
def test_every_command_explains_itself_with_an_example(tsttc: Tsttc, command: str) -> None:
    result = tsttc(command, "--help")
    assert result.exit_code == 0
    assert re.search(rf"^    (\S.* \| )?tsttc {command}\b", result.stdout, re.MULTILINE)
    # These print what is not theirs to wrap: a file, a receipt, a script.
    assert "--json" in result.stdout or command in {"convert", "receipt", "download", "completion"}


def examples() -> list[list[str]]:
    """Every example of every command's help, as words."""
    return [
        shlex.split(line.rpartition("tsttc ")[2], comments=True)
        for command in own_commands().values()
        for line in (command.help or "").splitlines()
        if re.match(r" +(\S.* \| )?tsttc ", line)
    ]


@pytest.mark.parametrize("words", examples(), ids=" ".join)
def test_example_of_the_help_is_called_rightly(words: list[str]) -> None:
    """Parse it as the shell would pass it; the files that it names need not exist."""
    words = list(itertools.takewhile(lambda word: word not in {">", "|"}, words))
    command = own_commands()[words[0]]
    parser = command.make_parser(click.Context(command))
    options, left, _ = parser.parse_args(words[1:])
    assert left == []
    assert all(parameter.name in options for parameter in command.params if parameter.required)


def modules_of(program: str) -> set[str]:
    """The packages that a process has loaded at the end of this program."""
    ending = "import sys; print(*sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\n{ending}"],
        capture_output=True,
        text=True,
        check=True,
        cwd=REPOSITORY,
    )
    return set(done.stderr.split())


@pytest.mark.slow
def test_help_loads_none_of_the_heavy_libraries() -> None:
    loaded = modules_of("from evaluator.cli import main; main(['--help'], standalone_mode=False)")
    heavy = {"numpy", "httpx2", "rich", "msgspec", "keyring", "cryptography", "jwt", "asyncio", "django"}
    assert "evaluator" in loaded
    assert heavy & loaded == set()


@pytest.mark.slow
def test_module_runs_as_the_command() -> None:
    done = process("score", GOOD, "--truth", TRUTH, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0
    assert "MiD" in done.stdout
    assert "60 sequences" in done.stdout


def test_public_names_are_there_although_they_load_late() -> None:
    import evaluator  # noqa: PLC0415 -- the package itself is what is looked at

    assert [name for name in evaluator.__all__ if getattr(evaluator, name, None) is None] == []
    with pytest.raises(AttributeError, match="no attribute 'absent'"):
        _ = evaluator.absent  # type: ignore[attr-defined]  # the point of the test


@pytest.mark.parametrize("kind", ["natural keys", "anno_ids"])
def test_keys_of_another_manifest_lead_to_that_manifest_and_other_faults_do_not(
    tsttc: Tsttc, tmp_path: Path, kind: str
) -> None:
    truth = read_truth(TRUTH)
    keys = truth.manifest.natural_keys if kind == "natural keys" else truth.manifest.anno_id_keys
    values = dict(zip(keys, truth.ttc_s.tolist(), strict=True))
    other, zero = tmp_path / "other.json", tmp_path / "zero.json"
    other.write_text(json.dumps({f"9{key}": value for key, value in values.items()}))
    zero.write_text(json.dumps(values | {keys[0]: 0}))
    for arguments in (("check", "--manifest", MANIFEST), ("score", "--truth", TRUTH)):
        for path, is_named in ((other, True), (zero, False)):
            result = tsttc(arguments[0], path, *arguments[1:])
            assert result.exit_code == 1
            assert ("tsttc manifest --split SPLIT --edition N -o other.csv" in result.stderr) is is_named
    compared = tsttc("compare", other, GOOD, "--truth", TRUTH)
    converted = tsttc("convert", GOOD, "--manifest", MANIFEST)
    assert "--edition N" in compared.stderr
    assert (converted.exit_code, "--edition N" in converted.stderr) == (1, False), "its keys need nothing"


def test_a_good_file_with_anno_ids_is_told_that_they_count_in_one_edition(
    tsttc: Tsttc, tmp_path: Path
) -> None:
    truth = read_truth(TRUTH)
    for kind in ("anno_id", "natural_key"):
        path = tmp_path / f"{kind}.json"
        path.write_text(
            json.dumps(dict(zip(truth.manifest.keys_of(kind), truth.ttc_s.tolist(), strict=True)))
        )
        result = tsttc("check", path, "--manifest", MANIFEST)
        assert result.exit_code == 0
        assert ("tsttc convert FILE --manifest OLD.csv" in result.stdout) is (kind == "anno_id")
