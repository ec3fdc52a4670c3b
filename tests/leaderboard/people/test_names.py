"""Names: which differ, which are taken for one another, and which are invalid."""

import re

import pytest

from leaderboard.errors.refusals import Refused
from leaderboard.models import Team, User
from leaderboard.people import teams
from leaderboard.people.names import MAX_LOOK, MAX_NAME, clean_name, confusable_with, skeleton

ALIKE = [
    ("PayPal", "PayPaI"),
    ("Owls", "0WLS"),
    ("Owls", "Оwls"),
    ("Owls", "ΟWLS"),
    ("Owls", "𝖮𝗐𝗅𝗌"),
    ("Owls", "O\u200bwls"),
    ("Owls", "Owl\u0323s"),
    ("Foo Lab", "Foo\u00a0 Lab"),
    ("modern", "modem"),
    ("вор", "Вор"),
    ("lab", "ʟab"),
    ("T-Net", "τ-Net"),
    ("fine", "ﬁne"),
    ("Strasse", "Straße"),
    ("Bjorn", "Bjørn"),
    ("a-b", "a—b"),
    ("it's", "it’s"),
    ('"x"', "“x”"),
    ("İstanbul", "Istanbul"),
    ("Owls", "Owls."),
    ("Owls", "Owls·"),
    ("Owls", "Owlsʼ"),
    ("Owls", "·Owls"),
    ("Owls", "“Owls”"),
    ("Owls", "(Owls)"),
    ("Owls", "‹Owls›"),
    ("Owls", "<Owls>"),
    ("Owls", "Owls‚"),
    ("Owls", "Owls´"),
    ("Owls", "Owls˙"),
    ("Owls", "Owls∙"),
    ("Owls", "O.w.l.s"),
    ("Owls", "_Owls_"),
    ("Owls", "Owls—"),
    ("TTC Net", "TTC‑Net"),
    ("TTC Net", "TTC_Net"),
    ("TTC Net", "TTC　Net"),
    ("TTC Net", "TTCNet"),
    ("TTC Net", "TTC/Net"),
    ("Net-A", "Net A"),
    ("Net 1.2", "Net 1-2"),
    ("Net 1.2", "Net 1․2"),
    ("Net v2", "Net-v2"),
    ("Net 1.2", "Net l.2"),
    ("Net 1.2", "Net I-2"),
    ("Net 1.0", "Net 1.O"),
    ("Net 2.1", "Net 2.l"),
    ("TTC Net", "TTC Net ✓"),
    ("TTC Net", "★ TTC Net"),
    ("TTC Net", "TTC Net®"),
    ("TTC Net", "TTC Net™"),
    ("TTC Net", "TTC Net ℠"),
    ("TTC Net", "TTC Net 🏆"),
    ("TTC Net", "TTC°Net"),
    ("TTC Net", "TTC─Net"),
    ("TTC Net", "TTC ━ Net"),
    ("TTC Net", "TTCーNet"),
    ("Owls", "🅾wls"),
    ("Owls", "🅞🅦🅛🅢"),
    ("Owls", "🄾🅆🄻🅂"),
    ("Straße", "Straβe"),
    ("Team Ibis", "Team Ibiς"),
]
DIFFERENT = [
    ("Team 1", "Team 7"),
    ("RTX", "UTX"),
    ("Net 1.2", "Net 12"),
    ("Net 1 1", "Net 11"),
    ("Foo+", "Foo"),
    ("Oil 2", "Oil 3"),
    ("Net 1.1", "Net 11"),
    ("サーバー", "サバ"),
    ("naive", "native"),
    ("深度", "深广"),
    ("Ада", "Ева"),
]
NO_NAMES = [
    ("\u00a0\u2003", "missing-field"),
    ("x" * (MAX_NAME + 1), "text-too-long"),
    ("Foo\x00", "bad-character"),
    ("Foo\u202eBar", "bad-character"),
    ("Foo\u200bBar", "bad-character"),
    ("Foo\u2028Bar", "bad-character"),
    ("Foo\u3164", "bad-character"),
    ("Foo\ud800", "bad-character"),
    ("F\u0301\u0302\u0303\u0304oo", "bad-character"),
    ("=+-", "bad-name"),
    ("anonymous 3f9c2a", "reserved-name"),
    ("Αnоnymous", "reserved-name"),
    ("(Anonymous) 3f9c2a", "reserved-name"),
    (".Anonymous 3f9c2a", "reserved-name"),
    ("“Anonymous 3f9c2a”", "reserved-name"),
    ("Team Anonymous", "reserved-name"),
    ("An-onymous 3f9c2a", "reserved-name"),
    ("3f9c2a (A n o n y m o u s)", "reserved-name"),
    ("Αnonymους 3f9c2a", "reserved-name"),
    ("🄰nonymous 3f9c2a", "reserved-name"),
    ("★ Anonymous 3f9c2a", "reserved-name"),
    ("✓", "bad-name"),
]
GOOD = [
    "Foo++",
    "=1+1",
    "<b>x</b>",
    "深度",
    "Müller & Søn",
    "τ-Net",
    "{{7*7}}",
    "O'Reilly",
    "\ufdfa" * MAX_NAME,
]


@pytest.mark.parametrize(("name", "other"), ALIKE)
def test_names_that_look_alike_have_one_look(name: str, other: str) -> None:
    assert skeleton(name) == skeleton(other)
    assert confusable_with(other, ["Something else", name]) == name


@pytest.mark.parametrize(("name", "other"), DIFFERENT)
def test_names_that_differ_to_the_eye_have_two(name: str, other: str) -> None:
    assert skeleton(name) != skeleton(other)
    assert confusable_with(other, [name]) is None


@pytest.mark.parametrize(("text", "code"), NO_NAMES)
def test_what_is_no_name_is_refused_with_its_reason(text: str, code: str) -> None:
    with pytest.raises(Refused) as refusal:
        clean_name("name", text)
    assert (refusal.value.code, refusal.value.field) == (code, "name")
    assert "expected" in str(refusal.value)
    str(refusal.value).encode()


@pytest.mark.parametrize("text", GOOD)
def test_names_keep_what_one_can_see(text: str) -> None:
    assert clean_name("name", f"  {text}\u00a0") == text
    assert len(skeleton(text)) <= MAX_LOOK


def test_no_two_teams_look_the_same_and_a_person_without_a_usable_name_gets_a_plain_one(db: None) -> None:
    names = ["Owls", "Оwls", "0WLS", "Foo\u202e", "", "Anonymous"]
    people = [User.objects.create_user(f"{i}@example.org", name=name) for i, name in enumerate(names)]
    made = []
    for person in people:
        made.append(teams.team_of(user=person).name)
        # Only the names of teams on the boards are taken.
        Team.objects.update(is_shown=True)
    assert made[:3] == ["Owls", "Оwls 2", "0WLS 3"]
    assert all(re.fullmatch("Team [0-9a-f]{6}", name) for name in made[3:])
    assert Team.objects.values("look").distinct().count() == len(names)
