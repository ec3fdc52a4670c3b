"""An answer that is made early leaves nothing of its request unread."""

import io
from collections.abc import Iterable
from typing import Any

import pytest

from leaderboard.web.middleware import unread_bodies
from leaderboard.web.middleware.unread_bodies import reading_to_the_end

SIZE = 300_000


def refusing(environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:
    """An application that reads a little, and refuses."""
    environ["wsgi.input"].read(10)
    return [b"refused"]


def left(body: io.BytesIO, **environ: Any) -> int:
    """How much of a body is left after the answer."""
    assert reading_to_the_end(refusing)({"wsgi.input": body, **environ}, None) == [b"refused"]
    return len(body.read())


def test_a_refused_request_is_read_to_its_end() -> None:
    assert left(io.BytesIO(b" " * SIZE), **{"wsgi.input_terminated": True}) == 0


def test_a_server_whose_bodies_have_no_end_is_left_alone() -> None:
    assert left(io.BytesIO(b" " * SIZE)) == SIZE - 10


def test_no_more_is_read_than_any_proxy_lets_through(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unread_bodies, "MAX_BYTES", 100_000)
    assert left(io.BytesIO(b" " * SIZE), **{"wsgi.input_terminated": True}) > SIZE - 200_000


def test_a_client_that_goes_away_meanwhile_is_no_fault() -> None:
    class Gone(io.BytesIO):
        def read(self, size: int | None = -1, /) -> bytes:
            if self.tell():
                raise ConnectionResetError
            return super().read(size)

    environ = {"wsgi.input": Gone(b" " * SIZE), "wsgi.input_terminated": True}
    assert reading_to_the_end(refusing)(environ, None) == [b"refused"]
