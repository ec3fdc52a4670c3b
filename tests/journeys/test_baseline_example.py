"""From frames to a row on the board, with the commands of the page about baselines."""

import re
import shlex
from pathlib import Path

import pytest
from django.utils import timezone
from pytest_django.live_server_helper import LiveServer

from leaderboard.editions import ground_truth
from leaderboard.models import User
from tests import builders
from tests.journeys.programs import EXAMPLES, command

pytestmark = pytest.mark.slow

PAGE = (EXAMPLES.parent / "docs" / "baselines.md").read_text(encoding="utf-8")


def commands_of(heading: str) -> list[list[str]]:
    """The `tsttc` commands of the shell blocks below a heading of the page, up to those with the dataset."""
    chapter = PAGE.partition(f"\n## {heading}\n")[2].partition("**With the dataset**")[0]
    blocks = re.findall(r"```sh\n(.*?)```", chapter, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith("tsttc ")]


def test_the_example_goes_from_frames_to_a_row_in_four_commands(
    live_server: LiveServer, transactional_db: None, benchmark: None, tmp_path: Path
) -> None:
    owner = User.objects.create_user("owner@example.org", "correct horse", name="Owls")
    ground_truth.import_truth(split_name="val", path=EXAMPLES / "baseline" / "truth.csv", now=timezone.now())
    tsttc = command(live_server.url, builders.token(owner), home=tmp_path)
    run, check, score, submit = commands_of("Run, check, score, submit")
    replacements = {"examples/baseline": "baseline", "alignment.json": str(tmp_path / "alignment.json")}

    def here(arguments: list[str]) -> list[str]:
        for old, new in replacements.items():
            arguments = [argument.replace(old, new) for argument in arguments]
        return [argument for argument in arguments if argument != "--wait"]  # no worker runs here

    done = [tsttc(*here(arguments)) for arguments in (run, check, score, submit)]
    assert [each.returncode for each in done] == [0] * 4, [each.stderr for each in done]
    assert "is good: 12 sequences" in done[1].stdout
    assert builders.score_all() == 1
    row = next(line for line in tsttc("board", "val", "--mine").stdout.splitlines() if "Owls" in line)
    mid = done[2].stdout.splitlines()[1].split()[1]
    assert row.split()[:1] == ["1"]
    assert mid in row
