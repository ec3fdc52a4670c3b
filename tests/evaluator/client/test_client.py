"""The API client against a real HTTP server, its faults included."""

from __future__ import annotations

import pytest

from evaluator.client.answers import BadAnswer, Refused, Unreachable
from evaluator.client.api import Client
from evaluator.client.exchange import RetryPolicy
from tests.evaluator.cli.recorded_site import CUT, CUT_SHORT, RecordedSite, Reply
from tests.evaluator.fake_time import FakeTime

SUBMISSIONS = "POST /api/v1/submissions"
ONE = "GET /api/v1/submissions/abc"
QUEUED = {"id": "abc", "state": "QUEUED", "split": "val", "method": "Foo++", "url": "/submissions/abc/"}
SCORED = QUEUED | {
    "state": "SCORED",
    "scores": {"mid": 14.21, "mid_crucial": None},
    "counts": {"overall": 60},
}


def send(client: Client, data: bytes = b'{"0": 5.3}') -> object:
    return client.submit(data, filename="p.json", split="val", method="Foo++")


@pytest.mark.parametrize("fault", [CUT, CUT_SHORT])
def test_upload_whose_answer_was_cut_is_sent_again_whole(
    client: Client, site: RecordedSite, clock: FakeTime, fault: str
) -> None:
    site.put(SUBMISSIONS, Reply(QUEUED, fault=fault), Reply(QUEUED, status=200))
    send(client, b'{"0": 1.5}')
    assert [request.parts()["file"][1] for request in site.requests] == [b'{"0": 1.5}'] * 2
    assert len(clock.slept_s) == 1


def test_server_that_keeps_cutting_is_reported_after_a_few_tries(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    site.put(ONE, Reply(fault=CUT))
    with pytest.raises(Unreachable) as caught:
        client.submission("abc")
    assert caught.value.was_connected
    assert len(site.requests) == RetryPolicy().n_tries
    assert clock.slept_s == sorted(clock.slept_s)


def test_one_s_own_method_may_be_on_any_page_and_the_token_goes_nowhere_else(
    client: Client, site: RecordedSite
) -> None:
    def page(name: str, following: str) -> Reply:
        link = f'<{following}>; rel="next"' if following else ""
        row = {"id": f"id-{name}", "name": name, "visibility": "PRIVATE"}
        return Reply([row], headers={"Link": link} if link else {})

    # Whatever host the link names, as that of a proxy would: only its question is taken.
    pages = [page("a", "https://elsewhere.example/x?after=1&limit=1"), page("b", "/m?after=2"), page("c", "")]
    site.put("GET /api/v1/methods", *pages)
    method = client.own_method("c")
    assert method is not None
    assert method.id == "id-c"
    paths = [request.path for request in site.requests]
    assert paths == ["/api/v1/methods", "/api/v1/methods?after=1&limit=1", "/api/v1/methods?after=2"]
    assert client.own_method("nowhere") is None


@pytest.mark.parametrize("value", ["soon", "-5", "²", "1e5"])
def test_senseless_retry_after_is_ignored(
    client: Client, site: RecordedSite, clock: FakeTime, value: str
) -> None:
    headers = {"Retry-After": value.encode().decode("latin-1")}
    site.put(ONE, Reply(status=503, headers=headers), Reply(SCORED))
    client.submission("abc")
    assert clock.slept_s[0] < 1


@pytest.mark.parametrize(
    "reply",
    [
        Reply(status=429, headers={"Retry-After": "86400"}),
        Reply(status=429),
        Reply(status=500),
        Reply(status=401),
        Reply(status=404),
    ],
    ids=["long quota", "quota without a time", "failure", "no token", "unknown"],
)
def test_what_waiting_does_not_cure_is_not_tried_again(
    client: Client, site: RecordedSite, clock: FakeTime, reply: Reply
) -> None:
    site.put(ONE, reply)
    with pytest.raises(Refused) as caught:
        client.submission("abc")
    assert caught.value.status == reply.status
    assert (len(site.requests), clock.slept_s) == (1, [])


@pytest.mark.parametrize(
    "body",
    [b"<html>gateway</html>", b"", b"[]", b'{"detail": ["x"], "title": 3, "problems": "none"}', b"\xff"],
)
def test_error_answer_of_any_kind_is_still_a_refusal(client: Client, site: RecordedSite, body: bytes) -> None:
    site.put(ONE, Reply(body, status=404, headers={"Content-Type": "text/html"}))
    with pytest.raises(Refused) as caught:
        client.submission("abc")
    assert (caught.value.title, caught.value.detail, caught.value.problems) == ("Not Found", "", ())


@pytest.mark.parametrize(
    ("body", "shape"),
    [
        (b"<html>hello</html>", "not JSON (application/json)"),
        (b"[1, 2]", "JSON, but no object"),
        (b'{"state": "SCORED"}', "Object missing required field `id`"),
        (b'{"id": 7, "state": "SCORED"}', "Expected `str`, got `int` - at `$.id`"),
    ],
)
def test_answer_of_another_shape_is_named(
    client: Client, site: RecordedSite, body: bytes, shape: str
) -> None:
    site.put(ONE, Reply(body))
    with pytest.raises(BadAnswer) as caught:
        client.submission("abc")
    assert caught.value.content == shape


def test_redirect_is_reported_and_not_followed(client: Client, site: RecordedSite) -> None:
    site.put(SUBMISSIONS, Reply(status=301, headers={"Location": "https://elsewhere.example/"}))
    with pytest.raises(BadAnswer, match=r"a redirect to https://elsewhere\.example/, which is not followed"):
        send(client)
    assert len(site.requests) == 1


def test_names_cannot_lead_out_of_their_part_of_the_address(client: Client, site: RecordedSite) -> None:
    with pytest.raises(Refused):
        client.submission("../splits?x=1#y")
    assert site.requests[0].path == "/api/v1/submissions/..%2Fsplits%3Fx%3D1%23y"


def test_token_is_not_shown(client: Client) -> None:
    assert "secret-token" not in repr(client)


def test_proxy_of_the_environment_is_not_asked_for_this_machine(
    site: RecordedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.setenv("ALL_PROXY", "http://127.0.0.1:9")
    site.put(ONE, Reply(SCORED))
    with Client(url=site.url) as client:
        assert client.submission("abc").is_final
