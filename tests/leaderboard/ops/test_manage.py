"""The entry of the commands, as a shell meets it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from django.conf import settings

from tests.services import environment_of_its_own

pytestmark = pytest.mark.slow


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
