"""Texts of exported tables."""

import pytest

from evaluator.metrics.registry import MID, RTE
from evaluator.tables.escaping import latex_comment
from evaluator.tables.layouts import brackets, mark_of, marked


@pytest.mark.parametrize(
    ("visibility", "pseudonym", "text"),
    [
        ("PRIVATE", None, "Owl (private)"),
        ("PRIVATE", "Anon 3f", "Owl (private)"),
        ("ANONYMOUS", "Anon 3f", "Owl (anonymous)"),
        ("ANONYMOUS", None, "Owl"),
        ("PUBLIC", None, "Owl"),
    ],
)
def test_a_row_that_others_see_differently_is_marked(
    visibility: str, pseudonym: str | None, text: str
) -> None:
    assert marked("Owl", mark_of(visibility=visibility, pseudonym=pseudonym)) == text


@pytest.mark.parametrize(
    ("text", "line"), [("edition 2\n\\input{x}", "% edition 2 \\input{x}"), ("", "%"), ("a\r\nb", "% a b")]
)
def test_a_comment_of_latex_is_one_line(text: str, line: str) -> None:
    assert latex_comment(text) == line


@pytest.mark.parametrize(
    ("unit", "n_units", "words"), [("day", 42, "over 42 days."), ("recording", 1, "over 1 recording.")]
)
def test_brackets_name_the_unit_of_the_bootstrap(unit: str, n_units: int, words: str) -> None:
    assert words in brackets(unit, n_units)


def test_a_heading_has_symbol_and_unit() -> None:
    assert (MID.heading, RTE.heading) == ("MiD ×10⁻⁴", "RTE %")
