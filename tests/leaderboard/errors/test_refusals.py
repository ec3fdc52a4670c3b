"""Texts that people write: told by what they show, and by nothing that takes long to find out."""

import unicodedata
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta

import pytest
from django.core.exceptions import ValidationError
from django.utils import timezone

from evaluator.metrics.protocol import SCORE_NAMES
from leaderboard.editions import corrections, papers, splits
from leaderboard.editions import policy as splits_policy
from leaderboard.editions.policy import Policy, policy_of
from leaderboard.errors.refusals import Refused, clean_text, clean_url
from leaderboard.mails import announcements
from leaderboard.methods import editing
from leaderboard.models import Edition, Method, Split, User
from leaderboard.moderation import hiding
from leaderboard.pages import texts
from leaderboard.people import teams, tokens
from leaderboard.people.names import clean_name
from leaderboard.web.maintain.maintainer_forms import reason_field
from tests import builders

COMPOSED = ["é", "ᾂ", "한", "ǖ"]  # of two, four, three and three characters


@pytest.mark.parametrize("character", COMPOSED)
def test_a_text_is_as_long_as_it_looks(character: str) -> None:
    text = unicodedata.normalize("NFD", character) * 500
    assert clean_text("note", text, limit=500) == character * 500


@pytest.mark.parametrize("read", [clean_name, lambda field, text: clean_text(field, text, limit=2000)])
def test_marks_without_end_are_refused_before_they_are_composed(read: Callable[[str, str], str]) -> None:
    # Putting a megabyte of them in order would take minutes, in which nobody else is answered.
    text = "a" + "\u0301" * 20_000 + "\u0316" * 20_000
    with pytest.raises(Refused) as refusal:
        read("name", text)
    assert refusal.value.code == "text-too-long"
    assert f"has {len(text)} characters" in str(refusal.value)


@pytest.mark.parametrize("code", [0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)])
def test_a_text_or_an_address_that_changes_the_direction_of_others_is_refused(code: int) -> None:
    with pytest.raises(Refused, match=f"the character U\\+{code:04X}"):
        clean_text("description", f"a{chr(code)}b", limit=9)
    with pytest.raises(Refused, match=f"the character U\\+{code:04X}"):
        clean_url("paper_url", f"https://example.org/{chr(code)}fdp")


@pytest.mark.parametrize("code", [0x00AD, 0x200B, 0x2028, 0x2060, 0xFEFF, 0xE0041])
def test_an_address_with_a_character_that_nobody_sees_is_refused(code: int) -> None:
    with pytest.raises(Refused, match=f"the character U\\+{code:04X}"):
        clean_url("paper_url", f"https://example.org/a{chr(code)}b")
    # A text may need one: some letters and flags are joined by it.
    assert clean_text("description", f"a{chr(code)}b", limit=9) == f"a{chr(code)}b"


# --- the doors ----------------------------------------------------------------------------------------------

TURNED = "a\u202eb"
NOW = timezone.now


def policy(**texts: str) -> Policy:
    return replace(policy_of(Split.objects.get(pk="test")), **texts)


def document(**texts: str) -> dict[str, object]:
    scores = dict.fromkeys(SCORE_NAMES, 1.0)
    source = {"title": "T", "authors": "A", "table": "1", "url": "https://a.example", "year": 2024}
    row = {"slug": "row", "name": "Row", "hardware": "H"}
    source |= {name: text for name, text in texts.items() if name in source}
    row |= {name: text for name, text in texts.items() if name not in source}
    return {
        "source": source,
        "columns": list(scores),
        "methods": [row],
        "results": {"test": {"row": list(scores.values())}},
    }


DOORS: dict[str, Callable[[Method, User, str], object]] = {
    **{
        f"method's {field}": lambda row, user, text, field=field: editing.edit(  # type: ignore[misc]
            method=row, changes=editing.cleaned({field: text}), actor=user
        )
        for field in ("description", "pretraining", "hardware")
    },
    **{
        f"method's {field}": lambda row, user, text, field=field: editing.edit(  # type: ignore[misc]
            method=row, changes=editing.cleaned({field: f"https://example.org/{text}"}), actor=user
        )
        for field in ("paper_url", "code_url")
    },
    "method's name": lambda _, user, text: builders.send(user, b"{}", method=text),
    "note": lambda _, user, text: builders.send(user, b"{}", note=text),
    "commit": lambda _, user, text: builders.send(user, b"{}", commit=text),
    "team's name": lambda row, user, text: teams.rename(team=row.team, name=text, actor=user, now=NOW()),
    "token's name": lambda _, user, text: tokens.create(user=user, name=text, now=NOW()),
    "split's title": lambda *given: splits_policy.checked(
        Split.objects.get(pk="test"), policy(title=given[2])
    ),
    "split's description": lambda *given: splits_policy.checked(
        Split.objects.get(pk="test"), policy(description=given[2])
    ),
    "way to be admitted": lambda *given: splits_policy.checked(
        Split.objects.get(pk="test"), policy(how_to_be_admitted=given[2])
    ),
    "split's announcement": lambda *given: splits_policy.checked(
        Split.objects.get(pk="test"), policy(announcement=given[2])
    ),
    "site's announcement": lambda *given: splits_policy.announce(
        text=given[2], ends_at=NOW() + timedelta(days=1), now=NOW(), actor=None
    ),
    "page": lambda *given: texts.edit(name="contact", text=given[2], replaces=0, actor=None, now=NOW()),
    "mail": lambda *given: announcements.cleaned(
        split=Split.objects.get(pk="test"), subject="S", text=given[2]
    ),
    "mail's subject": lambda *given: announcements.cleaned(
        split=Split.objects.get(pk="test"), subject=given[2], text="T"
    ),
    "reason to moderate": lambda row, _, text: hiding.clear_texts(method=row, reason=text, actor=None),
    "reason of a publication": lambda *given: corrections.roll_back(
        split_name="test", reason=given[2], now=NOW(), actor=None, replaces=None
    ),
    **{
        f"row's {field}": lambda *given, field=field: splits.import_published(  # type: ignore[misc]
            document=document(**{field: f"https://example.org/{given[2]}" if field == "url" else given[2]}),
            now=NOW(),
        )
        for field in ("name", "description", "hardware", "title", "authors", "table", "url")
    },
}


@pytest.mark.parametrize("door", DOORS)
def test_no_door_takes_a_text_that_changes_the_direction_of_others(
    edition: Edition, owner: User, door: str
) -> None:
    row = Method.objects.create(team=teams.team_of(user=owner), name="Foo")
    with pytest.raises((Refused, papers.BadDocument)) as refusal:
        DOORS[door](row, owner, TURNED)
    assert "U+202E" in str(refusal.value) or "cannot be printed" in str(refusal.value)


def test_a_file_name_is_kept_without_characters_that_nobody_sees(edition: Edition, owner: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), filename="a\u202egnp\u200b.json")
    assert sent.filename == "agnp.json"


def test_a_reason_in_a_form_of_maintainers_is_refused_as_everywhere() -> None:
    field = reason_field("H", max_length=500)
    with pytest.raises(ValidationError, match=r"U\+202E"):
        field.clean(TURNED)
    assert field.clean("A reason.\r\nIn two lines.") == "A reason.\r\nIn two lines."
