"""Problems and rejections as values."""

import copy
import json
import pickle
import re

import pytest

from evaluator import PROBLEM_CODES, Problem, Rejected
from evaluator.problems import MAX_LISTED, Findings, listed, n_problems_in_words, pointer, quoted


def test_codes_are_kebab_case_and_explained() -> None:
    for code, meaning in PROBLEM_CODES.items():
        assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", code)
        assert meaning.endswith(".")


def test_a_rejection_lists_its_problems_in_words_and_as_json() -> None:
    rejected = Rejected(
        [Problem("nan", "The value is NaN; expected …", "/7"), Problem("zero", "…")], n_problems=9
    )
    assert (
        str(rejected)
        == '9 problems; equal ones share a line:\n  1. "7": The value is NaN; expected …\n  2. …'
    )
    assert json.loads(rejected.to_json()) == {
        "n_problems": 9,
        "problems": [
            {"code": "nan", "message": "The value is NaN; expected …", "where": "/7"},
            {"code": "zero", "message": "…", "where": ""},
        ],
    }
    assert str(Rejected([Problem("zero", "…")])) == "1 problem:\n  1. …"


def test_the_longest_rejection_of_a_reader_is_one_that_may_come_from_a_process() -> None:
    findings = Findings()
    for code in PROBLEM_CODES:
        for number in range(30):
            findings.add(code, f"Message {number}.", "/a")
    for number in range(30):
        findings.add("nan", "Message 0.", pointer("predictions", f"{number:02}" + "\U0001f697" * 198))
    with pytest.raises(Rejected) as made:
        findings.raise_if_any()
    given = json.loads(made.value.to_json())
    assert max(len(problem["message"]) for problem in given["problems"]) > 40_000
    assert Rejected.from_dict(given).as_dict() == given


def test_a_rejection_survives_copying_and_pickling() -> None:
    rejected = Rejected([Problem("nan", "…", "/7")], n_problems=3)
    for twin in (copy.copy(rejected), pickle.loads(pickle.dumps(rejected))):
        assert (twin.problems, twin.n_problems) == (rejected.problems, 3)


def test_kinds_are_listed_apart() -> None:
    findings = Findings()
    for row in range(25):
        findings.add("nan", f"nan {row}", f"/{row}")
    for row in range(21):
        findings.add("zero", f"zero {row}", f"/{row}")
    findings.group("missing-keys", "7 missing", n_faults=7)
    with pytest.raises(Rejected) as rejected:
        findings.raise_if_any()
    messages = [problem.message for problem in rejected.value.problems]
    assert rejected.value.n_problems == 53
    assert messages == [
        *(f"nan {row}" for row in range(20)),
        *(f"zero {row}" for row in range(20)),
        "7 missing",
        "And 5 more like these: 25 in all.",
        "And 1 more like these: 21 in all.",
    ]


def test_equal_problems_share_a_line_that_names_their_pointers() -> None:
    findings = Findings()
    findings.add("zero", "0", "/a")
    for row in range(28_600):
        findings.add("not-a-number", "The value is null.", f"/{row}")
    findings.add("zero", "0", "/b")
    with pytest.raises(Rejected) as rejected:
        findings.raise_if_any()
    zero, null = rejected.value.problems
    assert (zero.where, zero.message) == ("/a", '0 1 more place has this problem: "b".')
    pointers = ", ".join(f'"{row}"' for row in range(1, 21))
    more = f"28,599 more places have this problem: {pointers}, … (the first 20)."
    assert (null.where, null.message) == ("/0", f"The value is null. {more}")
    assert rejected.value.n_problems == 28_602
    assert str(rejected.value).startswith("28,602 problems; equal ones share a line:\n")


def test_names_of_strangers_are_shown_in_printable_ascii() -> None:
    for text in ("\x1b[31m", "\ud800", "a" * 1000, "\u202e", '"\n'):
        assert quoted(text).isascii() or quoted(text).endswith('…"')
        assert quoted(text).isprintable()
        assert len(quoted(text)) < 400
        assert pointer(text).isascii()
        assert pointer(text).isprintable()


@pytest.mark.parametrize(
    ("n_problems", "n_lines", "words"),
    [
        (1, 1, "1 problem"),
        (7_000, 7_000, "7,000 problems"),
        (7_000, 1, "7,000 problems; equal ones share a line"),
    ],
)
def test_problems_are_counted_in_words(n_problems: int, n_lines: int, words: str) -> None:
    assert n_problems_in_words(n_problems, n_lines=n_lines) == words


def test_the_first_names_of_a_long_list_are_named() -> None:
    names = [str(number) for number in range(MAX_LISTED + 1)]
    assert listed(names[:2]) == "0, 1"
    assert listed(names[:-1]) == ", ".join(names[:-1])
    assert listed(names) == f"{', '.join(names[:-1])}, … (the first {MAX_LISTED})"
