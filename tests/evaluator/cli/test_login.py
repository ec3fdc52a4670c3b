"""login, logout and where the token comes from, with real keyrings of tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import keyring
import pytest

from tests.evaluator.cli.keyrings import LockedKeyring, NoKeyring, RememberingKeyring
from tests.evaluator.cli.recorded_site import IS_LEADERBOARD, RecordedSite, Reply, problem
from tests.evaluator.worlds import EXAMPLES, Tsttc

GOOD = EXAMPLES / "predictions.json"

TOKEN = "tsttc_" + "a1" * 32
ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
SCORED = {"id": ID, "state": "SCORED", "split": "val", "method": "Foo++"}


@pytest.fixture
def ring() -> Iterator[RememberingKeyring]:
    """A keyring that remembers."""
    backend = RememberingKeyring()
    keyring.set_keyring(backend)
    yield backend
    keyring.set_keyring(NoKeyring())


@pytest.fixture(autouse=True)
def signed_out(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TSTTC_TOKEN", "TSTTC_TOKEN_FILE", "TSTTC_URL"):
        monkeypatch.delenv(name, raising=False)


def test_login_tries_the_token_keeps_it_and_other_commands_find_it_and_the_server(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring
) -> None:
    site.put("GET /api/v1/quota", Reply([]))
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SCORED))
    result = tsttc("login", "--server", f"{site.url}/", stdin=f" {TOKEN}\n".encode())
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == f"The token is valid and saved for {site.url}/ (A keyring of the tests).\n"
    assert ring.kept == {("tsttc", site.url): TOKEN}
    assert tsttc("status", ID).exit_code == 0, "without naming token or server"
    assert [request.headers["Authorization"] for request in site.requests] == [f"Bearer {TOKEN}"] * 2
    assert TOKEN not in tsttc("login", "--server", site.url, "--json", stdin=TOKEN.encode()).output


def test_token_that_the_server_refuses_is_not_kept(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring
) -> None:
    words = "The token expired on 2026-11-20."
    site.put("GET /api/v1/quota", Reply(problem(words, code="token-expired"), 401))
    result = tsttc("login", "--server", site.url, stdin=TOKEN.encode())
    assert result.exit_code == 4
    assert result.stderr.startswith(f"Error: {words}\nCreate a token at {site.url}/tokens/")
    assert ring.kept == {}
    assert TOKEN not in result.output


def test_machine_without_a_keyring_keeps_the_token_in_a_file_that_only_its_owner_can_read(
    tsttc: Tsttc, site: RecordedSite, settings_home: Path
) -> None:
    site.put("GET /api/v1/quota", Reply([]))
    result = tsttc("login", "--server", site.url, stdin=TOKEN.encode())
    assert result.exit_code == 0
    [path] = settings_home.rglob("tokens.json")
    assert f"{path}, which only you can read; this machine has no keyring" in result.stdout
    assert TOKEN not in result.output
    assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SCORED))
    assert tsttc("status", ID).exit_code == 0
    assert site.requests[-1].headers["Authorization"] == f"Bearer {TOKEN}"
    assert tsttc("logout").stdout.startswith(f"The token for {site.url} is removed")
    assert not path.exists()


def test_a_file_that_is_named_gives_the_token_before_the_keyring(
    tsttc: Tsttc,
    site: RecordedSite,
    ring: RememberingKeyring,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ring.kept["tsttc", site.url] = "tsttc_other"
    site.put("GET /api/v1/quota", Reply([]))
    path = tmp_path / "token"
    path.write_text(f"{TOKEN}\r\n")
    monkeypatch.setenv("TSTTC_TOKEN_FILE", str(path))
    assert tsttc("quota", "--server", site.url).exit_code == 0
    assert site.requests[-1].headers["Authorization"] == f"Bearer {TOKEN}"
    path.unlink()
    result = tsttc("quota", "--server", site.url)
    assert result.exit_code == 4
    assert f"TSTTC_TOKEN_FILE names {path}, which cannot be read: No such file or directory." in result.stderr


def test_token_goes_to_nothing_that_is_no_leaderboard(tsttc: Tsttc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSTTC_TOKEN", TOKEN)
    for reply in (
        Reply(b"<html>404</html>", 404, {"Content-Type": "text/html"}),
        Reply(b"<html>hello</html>", 200, {"Content-Type": "text/html"}),
        Reply([{"name": "something else"}]),
    ):
        with RecordedSite() as other:
            other.put(IS_LEADERBOARD, reply)
            result = tsttc("submit", GOOD, "--split", "val", "--method", "Foo++", "--server", other.url)
            assert result.exit_code == 3
            assert f"Error: {other.url}" in result.stderr
            assert "did not answer like a leaderboard" in result.stderr
            assert other.requests == []


def test_keyring_that_stays_locked_is_an_error_and_means_no_token(tsttc: Tsttc, site: RecordedSite) -> None:
    keyring.set_keyring(LockedKeyring())
    site.put("GET /api/v1/quota", Reply([]))
    result = tsttc("login", "--server", site.url, stdin=TOKEN.encode())
    assert result.exit_code == 4
    assert "The keyring did not accept the token (the collection is locked)." in result.stderr
    keyring.set_keyring(NoKeyring())


def test_without_any_token_nothing_is_sent_and_both_ways_are_named(tsttc: Tsttc, site: RecordedSite) -> None:
    result = tsttc("status", ID, "--server", site.url)
    assert (result.exit_code, site.requests) == (4, [])
    assert "TSTTC_TOKEN is not set, and tsttc login has saved none" in result.stderr
    assert f"{site.url}/tokens/" in result.stderr


def test_environment_comes_before_the_keyring(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring.kept["tsttc", site.url] = TOKEN
    monkeypatch.setenv("TSTTC_TOKEN", "tsttc_other")
    site.put("GET /api/v1/quota", Reply([]))
    assert tsttc("quota", "--server", site.url).exit_code == 0
    assert site.requests[0].headers["Authorization"] == "Bearer tsttc_other"


def test_token_of_one_server_is_not_sent_to_another(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring
) -> None:
    ring.kept["tsttc", "https://elsewhere.example"] = TOKEN
    assert tsttc("status", ID, "--server", site.url).exit_code == 4
    assert site.requests == []


def test_logout_forgets_token_and_server(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring, settings_home: Path
) -> None:
    site.put("GET /api/v1/quota", Reply([]))
    assert tsttc("login", "--server", site.url, stdin=TOKEN.encode()).exit_code == 0
    assert list(settings_home.rglob("settings.json")) != []
    assert f"The token for {site.url} is removed" in tsttc("logout").stdout
    assert ring.kept == {}
    assert list(settings_home.rglob("settings.json")) == []
    again = tsttc("logout", "--server", site.url)
    assert (again.exit_code, again.stdout) == (
        0,
        f"There was no token for {site.url} on this machine.\n",
    )


def test_person_is_asked_and_the_token_is_not_shown(
    tsttc: Tsttc, site: RecordedSite, ring: RememberingKeyring, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("evaluator.cli.access.sys", terminal)
    site.put("GET /api/v1/quota", Reply([]))
    result = tsttc("login", "--server", site.url, stdin=f"{TOKEN}\n".encode())
    assert "the input is hidden" in result.stderr
    assert TOKEN not in result.output
    assert ring.kept == {("tsttc", site.url): TOKEN}
