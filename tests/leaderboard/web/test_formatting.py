"""Values as text on pages."""

import pytest

from leaderboard.web.formatting import breakable, grouped, with_noun


@pytest.mark.parametrize(("value", "text"), [(None, ""), (0, "0"), (999, "999"), (28_600, "28,600")])
def test_thousands_are_grouped(value: int | None, text: str) -> None:
    assert grouped(value) == text


@pytest.mark.parametrize(
    ("value", "nouns", "text"),
    [
        (1, "recording", "1 recording"),
        (2, "recording", "2 recordings"),
        (3, "person,people", "3 people"),
        (1, "person,people", "1 person"),
        (28_600, "sequence", "28,600 sequences"),
    ],
)
def test_a_count_has_its_noun(value: int, nouns: str, text: str) -> None:
    assert with_noun(value, nouns) == text


@pytest.mark.parametrize(
    ("path", "html"),
    [
        ("predictions", "predictions"),
        ("/api/v1", "/<wbr>api/<wbr>v1"),
        ("a/<b>&/", "a/<wbr>&lt;b&gt;&amp;/<wbr>"),
    ],
)
def test_a_path_may_break_after_each_slash(path: str, html: str) -> None:
    assert breakable(path) == html
