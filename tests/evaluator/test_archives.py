"""An archive is whole, or every file that is not as listed has its name in the answer."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from evaluator import archives, receipts
from evaluator.cli.receipts import verify
from tests.evaluator.test_receipts import OTHER_SEED, RECEIPT, SEED, fields

SCORES = f"{archives.RECEIPTS}/a.jwt"


def key_set(*seeds: bytes) -> bytes:
    return json.dumps(receipts.key_set([receipts.public_key(seed) for seed in seeds])).encode()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An archive of a board and a receipt."""
    folder = tmp_path / "archive"
    for name, data in {"boards/a.csv": b"rank\r\n", SCORES: RECEIPT, archives.KEYS: key_set(SEED)}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    archives.write_list(folder, site="https://example.org", made_at="2026-11-24T12:00:00+00:00")
    return folder


def run(*arguments: Any) -> Result:
    return CliRunner().invoke(verify, [*map(str, arguments)], standalone_mode=False)


def damage(folder: Path, **options: Any) -> dict[str, str]:
    return {each.where: each.code for each in archives.check(folder, **options).problems}


def test_a_whole_archive_is_reported_as_whole_without_a_server(folder: Path) -> None:
    result = run(folder)
    assert result.exception is None
    assert "The archive is whole." in result.stdout
    assert "The keys are those in the archive" in result.stdout
    assert "those in the archive" not in run(folder, "--keys", folder / archives.KEYS).stdout
    document = json.loads(run(folder, "--json").stdout)
    assert (document["n_files"], document["n_receipts"], document["problems"]) == (3, 1, [])
    assert document["digest"] in result.stdout


def test_every_damaged_file_is_named(folder: Path) -> None:
    (folder / "boards/a.csv").unlink()
    (folder / "boards/b.csv").write_bytes(b"rank\r\n")
    (folder / SCORES).write_bytes(RECEIPT[:-8] + b"AAAAAAAA")
    fault = run(folder).exception
    assert "archive is rejected: 4 problems" in str(fault)
    assert [(each.where, each.code) for each in fault.problems] == [
        ("boards/a.csv", "missing"),
        ("boards/b.csv", "additional"),
        (SCORES, "changed"),
        (SCORES, "receipt-altered"),
    ]
    assert fault.exit_code == 1


def test_a_list_that_was_changed_too_makes_no_receipt_valid(folder: Path) -> None:
    forged = receipts.sign(fields(scores={}), private_key=OTHER_SEED)
    (folder / SCORES).write_text(forged)
    archives.write_list(folder, site="https://example.org", made_at="")
    assert damage(folder) == {SCORES: "receipt-key-unknown"}
    (folder / archives.KEYS).write_bytes(key_set(OTHER_SEED))
    archives.write_list(folder, site="https://example.org", made_at="")
    assert damage(folder, keys=key_set(SEED)) == {SCORES: "receipt-key-unknown"}


@pytest.mark.parametrize("keys", [None, b"", b"{}", b"\xff"])
def test_receipts_are_not_taken_as_valid_without_keys(folder: Path, keys: bytes | None) -> None:
    (folder / archives.KEYS).unlink()
    if keys is not None:
        (folder / archives.KEYS).write_bytes(keys)
    archives.write_list(folder, site="https://example.org", made_at="")
    assert damage(folder) == {archives.KEYS: "receipt-keys"}
    assert damage(folder, keys=b"{}") == {"--keys": "receipt-keys"}


@pytest.mark.parametrize(
    "text",
    [
        *(None, "{", "[]", "[" * 100_000, '{"format": 9}', '{"format": 1, "files": 3}'),
        '{"format": 1, "files": {"a": "b"}, "site": "https://example.org"}',
    ],
)
def test_a_folder_without_a_sound_list_is_no_archive(folder: Path, text: str | None) -> None:
    (folder / archives.LIST).unlink()
    if text is not None:
        (folder / archives.LIST).write_text(text)
    (problem,) = run(folder).exception.problems
    assert "no archive.json of the format 1, or a damaged one; expected an archive" in problem.message
