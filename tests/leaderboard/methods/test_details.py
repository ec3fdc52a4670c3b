"""Details of a method: typed, checked, shown, and filters of the board."""

import json
from typing import Any

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client

from leaderboard.boards import filters, listing
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing
from leaderboard.methods.details import DETAILS
from leaderboard.models import AuditEvent, BoardVersion, Edition, Method, Split, Submission, User
from tests import builders, pages

ANYBODY = AnonymousUser()
WHOLE: dict[str, Any] = {
    "description": "What it does.",
    "paper_url": "https://example.org/paper",
    "code_url": "https://example.org/code",
    **{detail.name: detail.example for detail in DETAILS},
    # What tests below name.
    "uses_extra_data": True,
    "pretraining": "ImageNet-1k",
    "n_parameters": 31_000_000,
    "latency_ms": 41.5,
}


def pairs_of(name: str, *values: object) -> list[tuple[str, object]]:
    return [(name, value) for value in values]


BAD = [
    *pairs_of("n_frames", 1, 7, "six", 2.5, True, [], "²", float("inf")),
    *pairs_of("cameras", "one", 1, {}),
    *pairs_of("uses_nerf", "maybe", 1, "YES"),
    *pairs_of("n_parameters", 0, 10**16, "1.5", "25 apples", "1,5M", "9" * 5000, 1.5, True),
    *pairs_of("latency_ms", 0, "fast", "50 ms", float("nan"), 1e300, True, 10**400, []),
    *pairs_of("paper_url", "javascript:alert(1)", 5),
    *pairs_of("description", "x" * 2001, "a\x00b", "\ud800"),
    ("pretraining", ["ImageNet"]),
    *pairs_of("name", "", None, "a\u202eb", 5),
]


@pytest.fixture
def sent(edition: Edition, owner: User) -> Submission:
    """A scored submission of a public method."""
    made = builders.submit(owner, builders.predictions(edition, factor=1.2), method="Foo")
    builders.score_all()
    return made


@pytest.fixture
def method(sent: Submission) -> Method:
    """Its method."""
    return sent.method


def patch(client: Client, method: Method, user: User, body: Any) -> tuple[int, dict[str, Any]]:
    response = client.patch(
        f"/api/v1/methods/{method.pk}",
        body if isinstance(body, str) else json.dumps(body),
        content_type="application/json",
        headers={"Authorization": f"Bearer {builders.token(user)}"},
    )
    return response.status_code, response.json()


# --- the verb ----------------------------------------------------------------------------------------------


def test_every_detail_is_kept_and_taken_back_with_nothing(method: Method, owner: User) -> None:
    kept = editing.edit(method=method, changes=WHOLE, actor=owner)
    kept.refresh_from_db()
    assert {name: getattr(kept, name) for name in WHOLE} == WHOLE
    for nothing in (None, ""):
        editing.edit(method=method, changes=WHOLE, actor=owner)
        kept = editing.edit(method=method, changes=dict.fromkeys(WHOLE, nothing), actor=owner)
        kept.refresh_from_db()
        assert {getattr(kept, name) for name in WHOLE} == {None, ""}


def test_words_mean_what_values_do(method: Method, owner: User) -> None:
    words = {"n_frames": "6", "uses_nerf": "no", "uses_extra_data": "yes", "n_parameters": " 31000000 "}
    kept = editing.edit(method=method, changes={**WHOLE, **words, "latency_ms": "41.5"}, actor=owner)
    assert {name: getattr(kept, name) for name in WHOLE} == WHOLE


@pytest.mark.parametrize("count", ["25M", "25 m", "25,000,000", "0.025b"])
def test_a_count_is_read_as_people_write_it(method: Method, owner: User, count: str) -> None:
    assert (
        editing.edit(method=method, changes={"n_parameters": count}, actor=owner).n_parameters == 25_000_000
    )


@pytest.mark.parametrize(("name", "value"), BAD)
def test_what_it_cannot_be_is_named_with_what_was_expected(
    method: Method, owner: User, name: str, value: object
) -> None:
    with pytest.raises(Refused, match="expected") as refusal:
        editing.edit(method=method, changes={name: value}, actor=owner)
    assert refusal.value.field == name
    str(refusal.value).encode()
    assert AuditEvent.objects.filter(verb="edited").count() == 0


def test_a_latency_needs_its_hardware(method: Method, owner: User) -> None:
    with pytest.raises(Refused, match="what the latency was measured on"):
        editing.edit(method=method, changes={"latency_ms": 3.5}, actor=owner)
    editing.edit(method=method, changes={"latency_ms": 3.5, "hardware": "one GPU"}, actor=owner)
    with pytest.raises(Refused, match="what the latency was measured on"):
        editing.edit(method=method, changes={"hardware": ""}, actor=owner)


def test_only_the_team_says_something_and_the_trail_knows_what_changed(
    method: Method, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    for other in (stranger, maintainer):
        with pytest.raises(Refused, match="Only the team"):
            editing.edit(method=method, changes={"n_frames": 2}, actor=other)
    number = BoardVersion.objects.get(split="test").number
    editing.edit(method=method, changes={"n_frames": 2, "cameras": ""}, actor=teammate)
    editing.edit(method=method, changes={"n_frames": 2}, actor=owner)
    assert BoardVersion.objects.get(split="test").number == number + 1
    (event,) = AuditEvent.objects.filter(verb="edited")
    assert (event.actor, event.details) == (teammate, {"fields": ["n_frames"]})


def test_a_name_changes_until_it_is_public_and_is_no_other_ones_of_the_team(
    edition: Edition, method: Method, owner: User, stranger: User
) -> None:
    with pytest.raises(Refused, match="keeps its name"):
        editing.edit(method=method, changes={"name": "Bar"}, actor=owner)
    data = builders.predictions(edition, factor=1.4)
    hidden = builders.submit(owner, data, method="Hidden", visibility="PRIVATE").method
    with pytest.raises(Refused, match="looks like 'Foo', the name of a method of your team"):
        editing.edit(method=hidden, changes={"name": "F0o"}, actor=owner)
    assert editing.edit(method=hidden, changes={"name": "Seen"}, actor=owner).name == "Seen"
    other = builders.submit(stranger, data, method="F0o", visibility="PRIVATE").method
    assert other.team != method.team
    with pytest.raises(Refused, match="looks like"):
        builders.submit(owner, data, method="FOO")


# --- the page ----------------------------------------------------------------------------------------------


def test_page_takes_the_details_and_shows_them(client: Client, method: Method, owner: User) -> None:
    client.force_login(owner)
    address = f"/methods/{method.pk}/edit/"
    form = pages.page(client.get(address)).one("main")
    assert "id_name" not in [element.attributes.get("id") for element in form.all("input")]
    sent = {name: {True: "yes", False: "no"}.get(value, value) for name, value in WHOLE.items()}
    assert client.post(address, sent).status_code == 302
    client.logout()
    shown = pages.page(client.get(f"/methods/{method.pk}/")).one("main").text
    for words in (
        "41.5 ms latency",
        "31,000,000 parameters",
        "one camera",
        "provided",
        "pretrained on ImageNet-1k",
    ):
        assert words in shown
    client.force_login(owner)
    response = client.post(address, {**sent, "n_parameters": "25 apples", "latency_ms": "fast"})
    message = pages.page(response).one("div", id="id_n_parameters_error").text
    assert message == "Enter a whole number, e.g. 25,000,000 or 25M."


# --- the API -----------------------------------------------------------------------------------------------


def test_program_says_and_reads_the_same(client: Client, method: Method, owner: User, stranger: User) -> None:
    status, answer = patch(client, method, owner, WHOLE)
    assert status == 200
    details = {name: answer["details"][name] for name in answer["details"]}
    assert details == {name: WHOLE[name] for name in details}
    assert patch(client, method, stranger, {"n_frames": 2})[0] == 404
    status, answer = patch(client, method, owner, {"n_frames": None})
    assert (status, answer["details"]["n_frames"], answer["description"]) == (200, None, "What it does.")
    assert client.get("/api/v1/methods").status_code == 401
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    assert [row["name"] for row in client.get("/api/v1/methods", headers=headers).json()] == ["Foo"]
    assert client.get("/api/v1/methods?limit=0", headers=headers).json()["code"] == "bad-limit"


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ({"visibility": "PUBLIC"}, "unknown-field"),
        ({"\ud800": 1}, "unknown-field"),
        ("null", "bad-value"),
        ('{"n_frames": 1e999}', "bad-value"),
        ("{", "parse-error"),
        ('{"n_frames": ' + "9" * 6000 + "}", "parse-error"),
        (f"[{'{},' * 50_000}{{}}]", "too-large"),
    ],
)
def test_nonsense_is_refused_in_words(
    client: Client, method: Method, owner: User, body: Any, code: str
) -> None:
    status, answer = patch(client, method, owner, body)
    assert (status, answer["code"]) == ({"parse-error": 400, "too-large": 413}.get(code, 422), code)


# --- filters -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_board_is_filtered_by_what_rows_say_and_ranks_stay(
    edition: Edition, method: Method, owner: User
) -> None:
    editing.edit(method=method, changes=WHOLE, actor=owner)
    data = builders.predictions(edition, factor=1.3)
    veiled = builders.submit(owner, data, method="Veiled", visibility="ANONYMOUS").method
    hidden = {"pretraining": "Larknet's own", "hardware": "the larks' GPU", "code_url": "https://example.org"}
    editing.edit(method=veiled, changes={"n_frames": 6, "n_parameters": 9_000, **hidden}, actor=owner)
    builders.score_all()
    split = Split.objects.select_related("current_edition").get(pk="test")

    def names(**params: str) -> list[str]:
        board = listing.board(split=split, viewer=ANYBODY, filters=filters.parse(params))
        assert all(ranks[entry.method] == entry.rank for entry in board.entries)
        assert board.n_in_all == 7
        return [entry.method for entry in board.entries if entry.kind == "submission"]

    ranks = {entry.method: entry.rank for entry in listing.board(split=split, viewer=ANYBODY).entries}
    both = ["Foo", veiled.pseudonym]
    for params, expected in (
        ({}, both),
        ({"frames": "6"}, both),
        ({"cameras": "one"}, ["Foo"]),
        ({"nerf": "no"}, ["Foo"]),
        ({"nerf": "yes"}, []),
        ({"extra": "yes", "frames": "6"}, ["Foo"]),
        ({"code": "no"}, [veiled.pseudonym]),
        ({"latency": "41.5"}, ["Foo"]),
        ({"latency": "41"}, []),
        ({"pretraining": "IMAGEnet"}, ["Foo"]),
        ({"pretraining": "lark"}, []),
        ({"parameters": "31M"}, both),
        ({"parameters": "30999999"}, [veiled.pseudonym]),
        ({"q": "OWL"}, ["Foo"]),
        ({"q": "veiled"}, []),
        ({"q": "anonymous"}, [veiled.pseudonym]),
        ({"frames": "", "q": " "}, both),
    ):
        assert sorted(names(**params)) == sorted(expected), params


@pytest.mark.slow
def test_a_filter_tells_nothing_of_what_an_anonymous_row_hides(
    client: Client, edition: Edition, method: Method, owner: User
) -> None:
    data = builders.predictions(edition, factor=1.3)
    veiled = builders.submit(owner, data, method="Veiled", visibility="ANONYMOUS").method
    builders.score_all()
    addresses = [
        f"{path}?{name}={text}"
        for path in ("/board/test/", "/api/v1/splits/test/board", "/board/test.csv")
        for name in ("pretraining", "hardware")
        for text in ("Larks", "arks", "l")
    ]

    def seen() -> list[bytes]:
        return [client.get(address).content for address in addresses]

    before = seen()
    hidden = {"pretraining": "Larks' corpus", "hardware": "The Larks' GPU"}
    editing.edit(method=veiled, changes=hidden, actor=owner)
    assert seen() == before
    assert not any(veiled.pseudonym.encode() in answer for answer in before)
    client.force_login(owner)
    mine = [answer for address, answer in zip(addresses, seen(), strict=True) if ".csv" not in address]
    assert all(b"Veiled" in answer for answer in mine)  # what is taken along has nothing of one's own


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *pairs_of("frames", "1", "²"),
        *(("cameras", "three"), ("nerf", "maybe"), ("paper", "\x00"), ("q", "x" * 81)),
        *pairs_of("latency", "fast", "nan", "0", "1e999"),
        *pairs_of("parameters", "many", "0", "0.0001", "-5", "25 GB", "٢٥M", "9" * 17),
    ],
)
def test_a_filter_that_is_none_is_named(client: Client, benchmark: None, name: str, value: str) -> None:
    with pytest.raises(filters.BadFilter, match="expected") as fault:
        filters.parse({name: value})
    assert fault.value.field == name
    for address in ("/board/test/", "/api/v1/splits/test/board"):
        response = client.get(address, {name: value})
        assert response.status_code == 400
        assert f"The filter '{name}' is" in response.content.decode().replace("&#x27;", "'")
