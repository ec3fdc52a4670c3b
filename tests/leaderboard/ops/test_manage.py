"""The entry of the commands, as a shell meets it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from django.conf import settings
from django.core.management import get_commands

from tests.services import REPOSITORY, environment_of_its_own


@pytest.mark.slow
def test_a_command_whose_reader_has_left_ends_without_a_traceback() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "manage.py", "check"],
        cwd=Path(settings.BASE_DIR),
        env=environment_of_its_own(),
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


def test_every_command_has_one_row_in_the_maintainers_guide_and_one_in_the_list() -> None:
    own = {name for name, app in get_commands().items() if app == "leaderboard"}
    guide = (REPOSITORY / "docs/maintainers.md").read_text("utf-8")
    table = guide.partition("## Where to find things\n")[2].partition("\n## ")[0]
    guide_rows = [set(re.findall(r"`(?:make )?(\w+)[^`]*`", row)) & own for row in table.splitlines()]
    assert sorted(name for row in guide_rows for name in row) == sorted(own)
    listed = (
        (REPOSITORY / "docs/operations.md").read_text("utf-8").partition("## The maintainers' commands\n")[2]
    )
    rows = re.findall(r"^\| `(\w+)", listed.partition("\n## ")[0], re.MULTILINE)
    assert own - set(rows) == {"build_wheel", "demo"}  # of the installation, and of `make demo`


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root has other accounts")
def test_maintainers_command_runs_as_the_account_with_the_settings_of_the_site(tmp_path: Path) -> None:
    script = (REPOSITORY / "deploy/tsttc-maintain").read_text("utf-8")
    (tmp_path / "tsttc.env").write_text("TSTTC_SITE_URL=https://board.example.org\n")
    (tmp_path / "tsttc-worker.env").write_text("TSTTC_FROM_EMAIL='Board <b@example.org>'\n")
    (tmp_path / "tsttc-web.env").write_text("TSTTC_SECRET_KEY=s\nTSTTC_RECEIPT_KEY=r\n")
    program = (
        "import os; print(os.getuid(), os.umask(0), *map(os.getenv, __import__('sys').argv[1:]), sep='|')"
    )
    (tmp_path / "manage.py").write_text(program)
    replaced = {
        "/etc/": f"{tmp_path}/",
        "/srv/tsttc/": f"{tmp_path}/",
        "/opt/tsttc/bin/python": sys.executable,
        '--reuid "$account" --regid "$account"': "--reuid root --regid root",
    }
    for original, test_value in replaced.items():
        assert original in script
        script = script.replace(original, test_value)
    names = ["TSTTC_PROCESS", "TSTTC_SITE_URL", "TSTTC_FROM_EMAIL"]
    assert run_script(script, *names) == (
        f"0|{0o007}|maintainer|https://board.example.org|Board <b@example.org>\n"
    )
    # Keys of the web process stay there, but for the command that signs, which runs as its account.
    keys = ["TSTTC_PROCESS", "TSTTC_SECRET_KEY", "TSTTC_RECEIPT_KEY"]
    assert run_script(script, *keys).endswith("|maintainer|None|None\n")
    assert run_script(script, "backup", *keys).endswith("|None|backup|None|None\n")
    assert run_script(script, "archive", *keys).endswith("|None|maintainer|None|r\n")
    accounts = (REPOSITORY / "deploy/tsttc-maintain").read_text("utf-8").partition("archive)")[2]
    assert "account=tsttc-web\n" in accounts.partition(";;")[0]


def run_script(script: str, *arguments: str) -> str:
    """What the program prints that the script runs: first, as here, its account, and its umask."""
    command = ["/bin/sh", "-c", script, "sh", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_every_command_that_a_document_or_a_page_names_is_there() -> None:
    sources = [*REPOSITORY.glob("docs/**/*.md"), *REPOSITORY.glob("templates/**/*.html")]
    sources += (REPOSITORY / "leaderboard").rglob("*.py")
    missing = [
        f"{source.relative_to(REPOSITORY)}: {name}"
        for source in sources
        for name in re.findall(r"(?:manage\.py|tsttc-maintain) (\w+)", source.read_text("utf-8"))
        if name not in get_commands() and name != "COMMAND"
    ]
    assert missing == []
