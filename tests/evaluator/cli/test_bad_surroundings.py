"""What is the fault of neither the file nor the leaderboard: disks, proxies, other web servers, silence."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.evaluator.cli.recorded_site import IS_LEADERBOARD, RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, Tsttc

FULL = Path("/dev/full")


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize(
    "arguments", [("--help",), ("score", EXAMPLES / "predictions.json", "--truth", EXAMPLES / "truth.csv")]
)
def test_full_disk_is_one_line_and_not_the_file_s_fault(arguments: tuple[object, ...]) -> None:
    command = [sys.executable, "-m", "evaluator", *map(str, arguments)]
    with FULL.open("w") as full:
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    words = "Error: Standard output cannot be written: No space left on device.\n"
    assert (result.returncode, result.stderr) == (2, words)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("--help",),
        ("score", "--help"),
        ("score", EXAMPLES / "predictions.json", "--truth", EXAMPLES / "truth.csv"),
        ("manifest", EXAMPLES / "truth.csv"),
    ],
)
def test_output_that_nobody_reads_any_more_ends_the_command_quietly(arguments: tuple[object, ...]) -> None:
    command = [sys.executable, "-m", "evaluator", *map(str, arguments)]
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        result = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, text=True, check=False)
    assert (result.returncode, result.stderr) == (141, "")


def test_proxy_that_refuses_is_named_without_its_password(
    tsttc: Tsttc, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("http_proxy", "http://me:secret@127.0.0.1:9")
    result = tsttc("board", "val", "--server", "http://leaderboard.example", "--timeout", "0.1")
    assert result.exit_code == 3
    assert "through the proxy 127.0.0.1:9, which the environment names: " in result.stderr
    assert "secret" not in result.stderr


def test_server_that_never_answers_is_given_up_in_time(tsttc: Tsttc) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        result = tsttc("board", "val", "--server", url, "--timeout", "0.05")
    assert (result.exit_code, "it took too long" in result.stderr) == (3, True)


def test_another_web_server_is_called_that_by_every_command(tsttc: Tsttc, site: RecordedSite) -> None:
    page = Reply(b"<html>Not found</html>", status=404, headers={"Content-Type": "text/html"})
    for path in (IS_LEADERBOARD, "GET /api/v1/splits/val/board", "GET /board/val/api/v1/splits"):
        site.put(path, page)
    result = tsttc("board", "val", "--server", site.url)
    assert (result.exit_code, "did not answer like a leaderboard: 404" in result.stderr) == (3, True)


def test_message_about_a_value_has_no_usage_lines(tsttc: Tsttc) -> None:
    result = tsttc("score", "nowhere.json", "--truth", EXAMPLES / "truth.csv")
    assert result.stderr == "Error: Invalid value for 'PREDICTIONS': File 'nowhere.json' does not exist.\n"
