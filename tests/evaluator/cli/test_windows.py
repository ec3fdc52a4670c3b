"""What Windows does otherwise: paths, line ends, byte order marks, the folder of settings."""

from pathlib import Path

import pytest

from evaluator import read_manifest, read_predictions, read_truth
from evaluator.cli import tokens
from tests.evaluator.worlds import EXAMPLES, Tsttc

MARK = b"\xef\xbb\xbf"


def windows_text(name: str) -> bytes:
    """A file of the examples as Notepad saves it."""
    return MARK + (EXAMPLES / name).read_bytes().replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")


def test_files_saved_by_windows_editors_mean_the_same(tsttc: Tsttc, tmp_path: Path) -> None:
    for name in ("predictions.json", "manifest.csv", "truth.csv"):
        (tmp_path / name).write_bytes(windows_text(name))
    manifest = read_manifest(tmp_path / "manifest.csv")
    assert manifest.digest == read_manifest(EXAMPLES / "manifest.csv").digest
    assert read_truth(tmp_path / "truth.csv").digest == read_truth(EXAMPLES / "truth.csv").digest
    saved = read_predictions(tmp_path / "predictions.json", manifest=manifest)
    assert (saved.ttc_s == read_predictions(EXAMPLES / "predictions.json", manifest=manifest).ttc_s).all()
    shown = tsttc("score", tmp_path / "predictions.json", "--truth", tmp_path / "truth.csv")
    assert shown.exit_code == 0, shown.stderr


@pytest.mark.parametrize("content", [MARK + b"tsttc_abc\r\n", "tsttc_abc\r\n".encode("utf-16")])
def test_a_token_file_may_begin_with_a_mark_and_end_with_any_line_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    path = tmp_path / "token.txt"
    path.write_bytes(content)
    monkeypatch.delenv("TSTTC_TOKEN", raising=False)
    monkeypatch.setenv("TSTTC_TOKEN_FILE", str(path))
    assert tokens.token_for("https://example.org") == "tsttc_abc"
