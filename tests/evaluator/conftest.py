"""What these tests share: the command itself, a server to speak to, and patience."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from click.testing import CliRunner, Result
from hypothesis import settings

from evaluator.cli import main
from tests.evaluator.recorded_site import RecordedSite

# How long an example takes says more about the machine than about the code.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")


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
