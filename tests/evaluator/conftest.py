"""Fixtures of these tests: the command itself, a server to speak to, and fake time."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import keyring
import pytest
from click.testing import CliRunner, Result

from evaluator.cli import main
from evaluator.client.api import Client
from tests.evaluator.cli.keyrings import NoKeyring
from tests.evaluator.cli.recorded_site import RecordedSite
from tests.evaluator.fake_time import FakeTime


@pytest.fixture(autouse=True)
def settings_home(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test its own settings and no keyring, as on a machine for CI."""
    home = own_folder / "home"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(home / "config"))
    monkeypatch.setenv("PYTHON_KEYRING_BACKEND", "keyring.backends.fail.Keyring")
    keyring.set_keyring(NoKeyring())
    return home


@pytest.fixture
def tsttc() -> Callable[..., Result]:
    """Run the command in this process."""

    def run(*arguments: object, stdin: bytes = b"") -> Result:
        return CliRunner().invoke(main, list(map(str, arguments)), input=stdin, prog_name="tsttc")

    return run


@pytest.fixture
def site() -> Iterator[RecordedSite]:
    """A server that gives recorded answers."""
    with RecordedSite() as running:
        yield running


@pytest.fixture
def at_site(site: RecordedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command speaks to the recorded site, with a token."""
    monkeypatch.setenv("TSTTC_URL", site.url)
    monkeypatch.setenv("TSTTC_TOKEN", "secret-token")


@pytest.fixture
def clock() -> FakeTime:
    """Time in which waiting costs nothing."""
    return FakeTime()


@pytest.fixture
def client(site: RecordedSite, clock: FakeTime) -> Iterator[Client]:
    """A client of the recorded site, in that time."""
    with Client(
        url=site.url + "/",
        token="secret-token",
        sleep=clock.sleep,
        monotonic_s=lambda: clock.now_s,
        rng=random.Random(0),
    ) as connected:
        yield connected
