"""Texts that people write: told by what they show, and by nothing that takes long to find out."""

import unicodedata
from collections.abc import Callable

import pytest

from leaderboard.errors.refusals import Refused, clean_text, clean_url
from leaderboard.people.names import clean_name

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


@pytest.mark.parametrize("code", [0x061C, 0x200E, 0x202A, 0x202E, 0x2066, 0x2069])
def test_a_text_or_an_address_that_changes_the_direction_of_others_is_refused(code: int) -> None:
    with pytest.raises(Refused, match=f"the character U\\+{code:04X}"):
        clean_text("description", f"a{chr(code)}b", limit=9)
    with pytest.raises(Refused, match=f"the character U\\+{code:04X}"):
        clean_url("paper_url", f"https://example.org/{chr(code)}fdp")
