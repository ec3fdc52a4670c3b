"""Markdown of maintainers becomes headings, lists and tables, and never markup of their own."""

import pytest

from leaderboard.web import equations, markdown
from tests import pages


@pytest.mark.parametrize(
    "text",
    [
        "<script>alert(1)</script>",
        "Hello <img src=x onerror=alert(1)> there",
        "<p style='color:red'>red</p>",
        "[here](javascript:alert(1))",
        "[here](JaVaScRiPt:alert(1))",
        "[here](data:text/html,x)",
        "<javascript:alert(1)>",
        "![a picture](https://elsewhere.example/x.png)",
        "# Title\n\n<b>bold</b>",
        "| a |\n|:-:|\n| <i>x</i> |",
    ],
)
def test_no_text_becomes_a_script_an_image_or_a_style(text: str) -> None:
    root = pages.read(f"<main>{markdown.page(text).html}</main>")
    elements = root.everything()
    assert {each.tag for each in elements} <= {
        "main",
        "p",
        "a",
        "h2",
        "div",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
    }
    assert all(
        set(each.attributes) <= {"href", "id", "class", "tabindex", "role", "aria-label"} for each in elements
    )
    hrefs = [each.attributes["href"] for each in elements if each.tag == "a"]
    assert all(href.startswith(("https://elsewhere.example/", "#")) for href in hrefs)


def test_a_page_has_no_title_of_its_own_and_headings_have_anchors() -> None:
    drawn = markdown.page("# One\n\n## Two words!\n\n## Two words\n")
    root = pages.read(drawn.html)
    assert [(each.tag, each.attributes["id"]) for each in root.children] == [
        ("h2", "one"),
        ("h2", "two-words"),
        ("h2", "two-words_1"),
    ]


def test_an_interval_stays_on_one_line_and_the_search_has_it_as_typed() -> None:
    drawn = markdown.page("From 1 to 5, **−2 to\n0.4**, 3\nto 4 and `6 to 7`; back\nto it.\n")
    source = str(drawn.html)
    for interval in ("1 to 5", "−2 to 0.4", "3 to 4"):
        assert interval.replace(" ", "\N{NO-BREAK SPACE}") in source
    assert "<code>6 to 7</code>; back to it." in source
    assert drawn.parts[0].text == "From 1 to 5, −2 to 0.4, 3 to 4 and 6 to 7; back to it."


def test_items_of_a_list_without_full_stops_are_set_apart_in_the_text() -> None:
    drawn = markdown.page("## A\n\nBoth:\n\n- one\n- two (2)\n- three.\n\nAnd more\n")
    assert drawn.parts[-1].prose == "Both: one · two (2) · three. And more"


def test_a_line_with_columns_stays_whole_and_its_output_scrolls() -> None:
    root = pages.read(markdown.page("```text\na  1  2  3\none two\n```\n\n```text\none two\n```\n").html)
    assert [each.attributes["class"] for each in root.all("span")] == ["line tabular", "line", "line"]
    assert ["tabindex" in each.attributes for each in root.all("pre")] == [True, False]


def test_a_number_stays_with_its_unit() -> None:
    drawn = markdown.page("At most 24\nhours, 0.05 s, 2 GB and 5 steps; `2 GB`.\n")
    assert "24\xa0hours, 0.05\xa0s, 2\xa0GB and 5 steps; <code>2 GB</code>" in str(drawn.html)
    assert drawn.parts[0].text == "At most 24 hours, 0.05 s, 2 GB and 5 steps; 2 GB."


def test_a_column_without_a_name_has_no_head_and_numbers_stand_right() -> None:
    root = pages.read(markdown.page("| | n |\n|---|--:|\n| a | 1 |\n").html)
    assert [each.text for each in root.all("th")] == ["n"]
    assert [each.text for each in root.all("td", class_="number")] == ["1"]


def test_a_part_has_the_text_below_its_heading() -> None:
    drawn = markdown.page("Before\n\n## A `b`\n\nOne *two*\nthree.\n\n```sh\nls -l\n```\n")
    assert [(part.heading.text, part.text) for part in drawn.parts] == [
        ("", "Before"),
        ("A b", "One two three.\nls -l\n"),
    ]


def test_code_without_a_language_is_an_output_which_gets_no_button() -> None:
    for text in ("```\na    1\nbb   2\n```\n", "    a    1\n    bb   2\n"):
        assert '<code class="language-text"><span class="line">a    1\n</span>' in markdown.page(text).html
    assert "language-sh" in markdown.page("```sh\ntsttc check a.json    # --manifest\n```\n").html


def test_short_cells_stay_in_one_line_and_long_ones_get_room() -> None:
    drawn = markdown.page(f"| a | b |\n|---|---|\n| 93.3 ± 0.6 | {'word ' * 9}|\n").html
    assert "<td>93.3\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}0.6</td>" in drawn
    assert '<td data-label="b" class="wraps">word word' in drawn, "with its head, for a phone"
    drawn = markdown.page("| a |\n|---|\n| Values lie beyond ±20 s: milliseconds |\n").html
    assert ">Values lie beyond ±20\N{NO-BREAK SPACE}s: milliseconds" in drawn, (
        "a sentence breaks between its words"
    )


def test_an_option_and_a_name_in_code_do_not_break_at_their_hyphens() -> None:
    for text in ("`tsttc check --manifest`", "```sh\ntsttc check --manifest\n```\n"):
        assert '<span class="together">--manifest</span>' in markdown.page(text).html
    drawn = markdown.page("`looks-like-ratios`, `a/b-c`").html
    assert drawn.count('<span class="together">') == drawn.count(">looks-like-ratios<") == 1


def test_a_long_name_breaks_at_its_dots_slashes_and_underscores_alone() -> None:
    drawn = markdown.page(
        "`/api/v1/methods/{id}/my_file.json`, `a.short_name`\n\n### tsttc_baselines.read_folder()"
    )
    assert "/api/<wbr>v1/<wbr>methods/<wbr>{id}/<wbr>my_<wbr>file.json<" in drawn.html
    assert ">a.short_name<" in drawn.html
    assert ">tsttc_<wbr>baselines.<wbr>read_<wbr>folder()<" in drawn.html


def test_an_equation_of_a_guide_is_mathml_and_one_of_a_maintainer_is_text() -> None:
    text = "```math\n\\frac{1}{\\hat{\\tau}}\n```"
    drawn = markdown.guide(text, link=str, image=lambda _: {}).html
    assert drawn.startswith('<math display="block"><mfrac><mn>1</mn><mover accent="true"><mi>τ</mi>')
    assert (
        '<p>With <math display="inline"><mi>τ</mi></math>.'
        in markdown.guide("With $`\\tau`$.", link=str, image=lambda _: {}).html
    )
    assert "<math" not in markdown.page(text).html
    with pytest.raises(ValueError, match=r"sin' is not known in an equation"):
        equations.mathml(r"\sin")
