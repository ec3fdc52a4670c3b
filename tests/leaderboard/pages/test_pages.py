"""Rules, contact, privacy, imprint, licence: edited by maintainers alone, with every text kept."""

import hashlib

import pytest
from django.conf import settings as known_settings
from django.contrib.messages.storage.cookie import CookieStorage
from django.test import Client
from django.utils import timezone

from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import AuditEvent, PageVersion, User
from leaderboard.pages import texts
from leaderboard.people import tokens
from leaderboard.web.account import shown_once
from tests import pages as html
from tests.leaderboard.web.test_every_page import assert_sound

RULES = "/maintain/pages/rules/"


def edit(text: str, *, actor: User | None, replaces: int = 0, name: str = "rules") -> PageVersion:
    return texts.edit(name=name, text=text, replaces=replaces, actor=actor, now=timezone.now())


def shown(client: Client, name: str = "rules") -> str:
    return assert_sound(client.get(f"/{name}/")).one("main").text


@pytest.mark.slow
@pytest.mark.parametrize("name", texts.PAGES)
def test_every_page_has_a_text_from_the_start_and_is_linked_from_every_page(
    client: Client, benchmark: None, name: str
) -> None:
    root = assert_sound(client.get(f"/{name}/"))
    assert root.one("h1").text == texts.PAGES[name].title
    assert len(root.one("main").text) > 100
    for address in ("/", "/docs/", "/nowhere/", "/accounts/login/"):
        footer = html.page(client.get(address)).one("footer")
        assert f"/{name}/" in [a.attributes["href"] for a in footer.all("a")]


def test_the_privacy_page_names_the_longest_life_of_a_token(client: Client, benchmark: None) -> None:
    assert "at most one year" in html.get(client, "/privacy/").one("main").text
    assert tokens.MAX_DAYS == 365


def test_the_privacy_page_names_every_cookie_and_how_long_it_lives(client: Client, benchmark: None) -> None:
    (table,) = (t for t in html.get(client, "/privacy/").all("table") if t.all("th")[0].text == "Cookie")
    rows = [[td.text for td in tr.all("td")] for tr in table.one("tbody").all("tr")]
    cookies = {name: lifetime for name, _, lifetime in rows}
    ours = {known_settings.SESSION_COOKIE_NAME, known_settings.CSRF_COOKIE_NAME, shown_once.COOKIE}
    assert set(cookies) == {*ours, CookieStorage.cookie_name}
    assert cookies["sessionid"].startswith(f"{known_settings.SESSION_COOKIE_AGE // 86_400} days")
    assert pytest.approx(365 * 86_400, rel=0.01) == known_settings.CSRF_COOKIE_AGE
    assert cookies["csrftoken"] == "One year"


def test_an_edited_page_is_shown_with_its_date_and_recorded(
    client: Client, benchmark: None, maintainer: User
) -> None:
    version = edit("## Ours\n\nBe **kind**.", actor=maintainer)
    text = shown(client)
    assert "Be kind." in text
    assert f"Last changed {version.written_at:%Y-%m-%d}." in text
    event = AuditEvent.objects.get(verb="edited")
    assert (event.noun, event.noun_id, event.actor) == ("Page", "rules", maintainer)
    assert event.details == {"version": 1, "sha256": hashlib.sha256(version.text.encode()).hexdigest()}


def test_only_maintainers_edit(owner: User) -> None:
    with pytest.raises(NotMaintainer):
        edit("Mine.", actor=owner)
    assert not PageVersion.objects.exists()


@pytest.mark.parametrize(
    ("text", "code"),
    [(" \n", "missing-field"), ("x" * 20_001, "text-too-long"), ("a\x00b", "bad-character")],
)
def test_a_text_that_is_none_is_refused(maintainer: User, text: str, code: str) -> None:
    with pytest.raises(Refused) as refused:
        edit(text, actor=maintainer)
    assert refused.value.code == code


def test_an_edit_of_a_text_that_is_no_longer_shown_is_refused(maintainer: User) -> None:
    edit("One.", actor=maintainer)
    with pytest.raises(Refused, match="Somebody changed this page"):
        edit("Another.", actor=maintainer, replaces=0)
    with pytest.raises(Refused, match="expected another"):
        edit("One.\r\n", actor=maintainer, replaces=1)
    assert texts.versions("rules")[0].text == "One.\n"


def test_the_maintainers_form_previews_saves_and_brings_back_earlier_texts(
    keeper: Client, benchmark: None
) -> None:
    form = assert_sound(keeper.get(RULES))
    assert "apply to every submission" in form.one("textarea").text
    sent = {"text": "# Ours\r\n\r\n<script>alert(1)</script>", "replaces": "0"}
    preview = assert_sound(keeper.post(RULES, {**sent, "preview": "1"})).one("section", class_="preview")
    assert preview.text == "Ours <script>alert(1)</script>"
    assert not PageVersion.objects.exists()
    assert keeper.post(RULES, sent).headers["Location"] == "/rules/"
    assert "Ours" in shown(keeper)
    assert "apply to every submission" in assert_sound(keeper.get(f"{RULES}?version=0")).one("textarea").text
    assert "# Ours" in assert_sound(keeper.get(f"{RULES}?version=1")).one("textarea").text
    stale = keeper.post(RULES, {**sent, "text": "Other."})
    assert stale.status_code == 422
    assert "Somebody changed this page" in assert_sound(stale).one("form", class_="fields").text


def test_maintainers_see_that_nobody_wrote_the_imprint_and_visitors_do_not(
    keeper: Client, benchmark: None, maintainer: User
) -> None:
    asked = "has no name or postal address yet"
    for address in ("/maintain/", "/maintain/pages/"):
        assert asked in assert_sound(keeper.get(address)).one("main").text
    assert asked not in shown(Client(), "imprint")
    edit("Ada Lovelace, London", actor=maintainer, name="imprint")
    for address in ("/maintain/", "/maintain/pages/"):
        assert asked not in assert_sound(keeper.get(address)).one("main").text
