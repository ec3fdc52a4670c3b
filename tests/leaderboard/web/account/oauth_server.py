"""A provider on loopback: an OAuth server with what ORCID and GitHub answer, or with what the test says."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs

import pytest
from allauth.socialaccount.providers.github.views import GitHubOAuth2Adapter
from allauth.socialaccount.providers.orcid.views import OrcidOAuth2Adapter

CODE, TOKEN = "code-of-the-browser", "token-of-the-provider"
IID = "0000-0002-1825-0097"
HANGS = object()


@dataclass
class Provider:
    """Its answers by path, and the requests that it got."""

    url: str
    answers: dict[str, Any] = field(default_factory=dict)
    sent: list[tuple[str, dict[str, list[str]]]] = field(default_factory=list)
    released: threading.Event = field(default_factory=threading.Event)

    def github(self, *, number: int = 42, login: str = "owl", emails: Any = ()) -> None:
        """Answer as GitHub for a person with these addresses: text, verified, primary."""
        rows = [{"email": text, "verified": known, "primary": first} for text, known, first in emails]
        self.answers = {
            "/login/oauth/access_token": {"access_token": TOKEN, "token_type": "bearer"},
            "/user": {"id": number, "login": login, "name": "An Owl", "email": None, "bio": "private"},
            "/user/emails": rows,
        }

    def orcid(self, *, emails: Any = ()) -> None:
        """Answer as ORCID for a person with these public addresses."""
        rows = [{"email": text, "verified": known, "primary": first} for text, known, first in emails]
        name = {"given-names": {"value": "An"}, "family-name": {"value": "Owl"}}
        self.answers = {
            "/oauth/token": {"access_token": TOKEN, "orcid": IID, "expires_in": 631138518},
            f"/v3.0/{IID}/record": {
                "orcid-identifier": {"path": IID, "uri": f"https://orcid.org/{IID}"},
                "person": {"name": name, "emails": {"email": rows}},
            },
        }


@contextmanager
def running() -> Iterator[Provider]:
    """The server, until the block ends."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer()

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0))).decode()
            provider.sent.append((self.path, parse_qs(body)))
            self._answer()

        def _answer(self) -> None:
            answer = provider.answers.get(self.path.partition("?")[0], (404, b"not here"))
            if answer is HANGS:
                provider.released.wait(30)
                return
            status, body = answer if isinstance(answer, tuple) else (200, json.dumps(answer).encode())
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *args: object) -> None:
            """Keep the log of requests out of the tests' output."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        provider = Provider(f"http://127.0.0.1:{server.server_port}")
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield provider
        finally:
            provider.released.set()
            server.shutdown()
            thread.join()


def lead_to(monkeypatch: pytest.MonkeyPatch, provider: Provider) -> None:
    """Lead both providers' addresses to this server."""
    monkeypatch.setattr(GitHubOAuth2Adapter, "access_token_url", f"{provider.url}/login/oauth/access_token")
    monkeypatch.setattr(GitHubOAuth2Adapter, "profile_url", f"{provider.url}/user")
    monkeypatch.setattr(GitHubOAuth2Adapter, "emails_url", f"{provider.url}/user/emails")
    monkeypatch.setattr(OrcidOAuth2Adapter, "access_token_url", f"{provider.url}/oauth/token")
    monkeypatch.setattr(OrcidOAuth2Adapter, "profile_url", f"{provider.url}/v3.0/%s/record")
