"""Boards to take along: the page's numbers, and names of strangers that have no power in any form."""

import csv
import html
import io
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone
from markdown_it import MarkdownIt

from evaluator.tables.escaping import latex, markdown, one_line
from leaderboard.models import Edition, Method, User
from leaderboard.submissions import intake
from tests import board_rows, builders, pages
from tests.services import REQUIRED

FORMS = ("csv", "json", "tex", "md", "bib")
HOSTILE = (
    "=HYPERLINK(1)|*b* <script>alert(1)</script>",
    r"\input{/etc/passwd} $x^2$ 50 % _a_ #1 & ~ } {",
    "--- ''quoted'' `` ?` \"x\" [1] (y) ]",
    "中文 Ελληνικά Ŝtrąża 😀 Müller",
    "@everyone www.example.org https://example.org a\\",
    "![image](https://example.org/x.png) | --- |",
)
BIDI = "Turned \u202eround\u202c"


@pytest.fixture
def hostile(edition: Edition, owner: User) -> list[Method]:
    """A board whose methods, teams and addresses are called what nobody should be called."""
    methods = board_rows.fill(edition, n=len(HOSTILE) + 1, user=owner)
    for method, name in zip(methods, (*HOSTILE, BIDI), strict=True):
        Method.objects.filter(pk=method.pk).update(
            name=name, description=name, paper_url=r"https://example.org/a_b%20{c}?x=1&y=#\d"
        )
        method.team.name = name[:70]
        method.team.save()
    return methods


def text_of(client: Client, form: str, query: str = "", split: str = "test") -> str:
    response = client.get(f"/board/{split}.{form}{query}", follow=True)
    assert response.status_code == 200, response.content[:300]
    return response.text


def csv_rows(client: Client, query: str = "") -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text_of(client, "csv", query))))


def page_numbers(client: Client, query: str = "") -> list[list[str]]:
    """The ten numbers of every row as the page shows them."""
    rows = pages.board_rows(pages.page(client.get(f"/board/test/{query}")))
    return [[_number(text) for text in row[2:12]] for row in rows]


def _number(text: str) -> str:
    match = re.match(r"[0-9.]+|–", text)
    return match[0] if match else text


# --- the same as the page ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("query", ["", "?sort=-rte_large", "?q=scale&sort=method", "?code=yes"])
def test_every_form_has_the_page_s_rows_in_its_order_with_its_numbers(
    edition: Edition, owner: User, client: Client, query: str
) -> None:
    board_rows.fill(edition, n=8, user=owner)
    shown = page_numbers(client, query)
    names = csv_rows(client, query)[0].keys() - {"rank"}
    assert "mid_crucial" in names
    from_csv = [
        [v or "–" for k, v in row.items() if re.match(r"(mid|rte)", k)] for row in csv_rows(client, query)
    ]
    assert from_csv == shown
    lines = [line for line in text_of(client, "md", query).splitlines() if line.startswith("|")][2:]
    assert [[re.sub(r"\*", "", c.strip()) for c in line.split("|")[4:14]] for line in lines] == shown
    body = text_of(client, "tex", query).partition("\\midrule\n")[2].partition("\\bottomrule")[0]
    cells = [
        [
            re.sub(r"\\(textbf|underline)\{(.*)\}", r"\2", c.removesuffix(" \\\\").strip())
            for c in r.split(" & ")
        ]
        for r in body.splitlines()
    ]
    assert [[c.replace("--", "–") for c in row[3:]] for row in cells] == shown
    values = [list(e["scores"].values()) for e in json.loads(text_of(client, "json", query))["entries"]]
    assert [[f"{float(text):g}" for text in row] for row in shown] == [
        [f"{v:g}" for v in row] for row in values
    ]


def test_best_is_bold_and_second_is_underlined_as_on_the_page(
    edition: Edition, owner: User, client: Client
) -> None:
    board_rows.fill(edition, n=8, user=owner)
    table = pages.page(client.get("/board/test/")).one("table", class_="board")
    best = sorted(_number(e.text) for e in table.all("strong"))
    second = sorted(_number(e.text) for e in table.all("u"))
    tex, md = text_of(client, "tex"), text_of(client, "md").rpartition("lower is better")[0]
    assert sorted(re.findall(r"\\textbf\{([0-9.]+)\}", tex)) == best
    assert sorted(re.findall(r"\\underline\{([0-9.]+)\}", tex)) == second
    assert sorted(re.findall(r"\*\*([0-9.]+)\*\*", md)) == best
    assert sorted(re.findall(r" \*([0-9.]+)\*", md)) == second


def test_intervals_come_for_who_asks(edition: Edition, owner: User, client: Client) -> None:
    board_rows.fill(edition, n=3, user=owner)
    assert r"\scriptsize" not in text_of(client, "tex")
    assert text_of(client, "tex", "?intervals=1").count(r"\scriptsize") == 30
    assert re.search(r"\*?[0-9.]+\*? \[[0-9.]+, [0-9.]+\]", text_of(client, "md", "?intervals=1"))
    for form in ("tex", "md"):
        words = r"95\\?% confidence interval, bootstrap over 24 recordings.*rank range at 95"
        assert re.search(words, text_of(client, form, "?intervals=1"))
        assert not re.search(words, text_of(client, form)), "there are no brackets to be explained"
    rows = csv_rows(client, "?intervals=1")
    scored = next(row for row in rows if row["kind"] == "submission")
    assert float(scored["mid_low"]) < float(scored["mid"]) < float(scored["mid_high"])
    assert next(row for row in rows if row["kind"] == "published")["mid_low"] == ""
    for query, n in (("", 0), ("?intervals=1", 10)):
        entries = json.loads(text_of(client, "json", query))["entries"]
        assert {len(e["intervals"]) for e in entries if e["kind"] == "submission"} == {n}
    for form in ("tex", "json"):
        assert client.get(f"/board/test.{form}?intervals=perhaps", follow=True).status_code == 400


def test_tables_say_what_they_were_taken_from(edition: Edition, owner: User, client: Client) -> None:
    board_rows.fill(edition, n=2, user=owner)
    for form in ("tex", "md"):
        asked_at = timezone.now()
        text = text_of(client, form, "?sort=rte").replace("\\", "").replace("&#58;", ":")
        assert f"/board/test/editions/{edition.number}/?sort=rte" in text
        assert edition.ground_truth_id in text
        # Midnight may pass meanwhile.
        assert any(f"{at:%Y-%m-%d}" in text for at in (asked_at, timezone.now()))


def test_the_board_as_of_a_time_is_taken_as_of_that_time(
    edition: Edition, owner: User, client: Client
) -> None:
    board_rows.fill(edition, n=2, user=owner)
    assert "Method 0" not in text_of(client, "csv", "?at=2020-01-01")
    assert "/board/test/?at=2020-01-01" in text_of(client, "tex", "?at=2020-01-01")


def test_editions_are_taken_along_at_an_address_that_stays(
    edition: Edition, owner: User, client: Client
) -> None:
    board_rows.fill(edition, n=2, user=owner)
    for form in FORMS:
        response = client.get(f"/board/test/editions/1.{form}", follow=True)
        assert response.status_code == 200
        assert form == "json" or f"tsttc-test-edition-1.{form}" in response["Content-Disposition"]
    assert client.get("/board/test/editions/9.csv").status_code == 404


# --- who may see what --------------------------------------------------------------------------------------


def test_what_was_withdrawn_stays_in_data_and_leaves_the_tables_of_papers(
    edition: Edition, owner: User, client: Client
) -> None:
    submission = builders.submit(owner, builders.predictions(edition), method="Gone")
    builders.score_all()
    intake.withdraw(submission=submission, actor=owner, now=timezone.now())
    assert next(row for row in csv_rows(client) if row["method"] == "Gone")["withdrawn_at"]
    assert "Gone" not in text_of(client, "tex")
    assert "Gone" not in text_of(client, "md")


# --- names without power -----------------------------------------------------------------------------------


def test_no_name_is_a_formula_of_a_spreadsheet(hostile: list[Method], client: Client) -> None:
    for row in csv.reader(io.StringIO(text_of(client, "csv"))):
        assert [cell for cell in row if cell[:1] in {*"=+-@\t\r＝＋－＠"}] == []
    assert "'=HYPERLINK(1)|*b* <script>alert(1)</script>" in {row["method"] for row in csv_rows(client)}


def test_no_name_is_markup_in_a_note(hostile: list[Method], client: Client) -> None:
    text = text_of(client, "md")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {14}
    assert "<script" not in text
    assert not re.search(r"(?<!\\)\]\(http", text)
    assert "www." not in text
    assert BIDI[7] not in text
    assert re.search(r"<http\S+/board/test/editions/1/>", text), "the address is a link"
    assert "tsttc-1" in text, "nothing is escaped that is plain anyway"
    renderer = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    for name in (*HOSTILE, "- a", "1. b", "=c", "+ d", "http://x.org_a_", "#12 & &amp; $x$ ~~y~~"):
        shown = renderer.render(markdown(name)).strip()
        assert html.unescape(shown.removeprefix("<p>").removesuffix("</p>")) == one_line(name)


def test_bibtex_has_no_unbalanced_brace_and_no_key_twice(hostile: list[Method], client: Client) -> None:
    text = text_of(client, "bib")
    assert text.count("{") == text.count("}")
    keys = re.findall(r"^@misc\{([a-z0-9-]+),$", text, flags=re.MULTILINE)
    assert len(keys) == len(set(keys)) == 2 + len(hostile)
    assert "eprint = {2309.01539}" in text
    board = text.partition("@misc{tsttc-leaderboard-test-edition-1,")[2].partition("@misc")[0]
    assert "/board/test/editions/1/}" in board
    assert "ground truth sha256:" in board
    assert f"urldate = {{{timezone.now():%Y-%m-%d}}}" in board, "the day of the visit"


def test_board_that_changed_on_an_anonymous_day_says_the_day_alone(
    edition: Edition, owner: User, client: Client
) -> None:
    builders.submit(owner, builders.predictions(edition), method="Secret Net", visibility="ANONYMOUS")
    builders.score_all()
    today = f"{timezone.now():%Y-%m-%d}"
    for form in ("tex", "md"):
        assert re.search(rf"As of {today}$", text_of(client, form), flags=re.MULTILINE)
    for address in ("/board/test/", "/board/test/charts/"):
        page = client.get(address, follow=True).text
        assert f'updated <time datetime="{today}">{today}</time>' in page
        assert "23:59" not in page


def test_a_team_is_not_cited_as_author_of_the_benchmarks_paper(
    edition: Edition, owner: User, client: Client
) -> None:
    method, *_ = board_rows.fill(edition, n=1, user=owner)
    Method.objects.filter(pk=method.pk).update(paper_url="https://arxiv.org/abs/2309.01539")
    assert text_of(client, "bib").count("eprint = {2309.01539}") == 1
    page = client.get(f"/methods/{method.pk}/").text
    citation = page.partition(f"-{method.pk.hex[:6]},\n")[2].partition("\n}")[0]
    assert f"/methods/{method.pk}/}}" in citation
    assert "test, edition 1}" in citation
    assert "eprint" not in citation


def test_a_methods_page_has_its_row_of_the_latex_table(edition: Edition, owner: User, client: Client) -> None:
    method, *_ = board_rows.fill(edition, n=1, user=owner)
    row = pages.get(client, f"/methods/{method.pk}/").one("code", id="latex-row").raw_text
    assert row in text_of(client, "tex").splitlines()


def test_the_sentence_to_quote_stands_on_a_methods_page_in_latex(
    edition: Edition, owner: User, client: Client
) -> None:
    method, *_ = board_rows.fill(edition, n=1, user=owner)
    page = pages.get(client, f"/methods/{method.pk}/")
    sentence = page.one("code", id="citation-test").text
    in_latex = page.one("code", id="citation-latex-test").raw_text
    assert in_latex == latex(sentence)
    assert in_latex.isascii()
    assert r"$\times$10$^{-4}$" in in_latex
    assert "[U+" not in in_latex


def test_a_team_finds_nothing_to_paste_that_names_its_anonymous_method(
    edition: Edition, owner: User, signed_in: Client
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Secret Net", visibility="ANONYMOUS")
    builders.score_all()
    page = pages.get(signed_in, f"/methods/{sent.method.pk}/")
    for pasted in ("bibtex", "latex-row", "citation-test", "citation-latex-test"):
        text = page.one("code", id=pasted).raw_text
        assert sent.method.pseudonym in text
        assert "secret" not in text.lower()
        assert sent.method.team.name not in text
    assert "Do not show the signed receipt while the method is anonymous" in page.text
    assert "tsttc verify" not in page.text


@pytest.fixture
def pdflatex() -> str:
    """The TeX that Debian calls texlive-latex-base; CI has it."""
    program = shutil.which("pdflatex")
    if program is None:
        if REQUIRED:
            pytest.fail("pdflatex is not installed")
        pytest.skip("pdflatex is not installed (Debian: texlive-latex-base, texlive-latex-recommended)")
    return program


@pytest.mark.slow
def test_latex_and_bibtex_compile_with_any_name(
    hostile: list[Method], client: Client, tmp_path: Path, pdflatex: str
) -> None:
    (tmp_path / "plain.tex").write_text(text_of(client, "tex"), encoding="utf-8")
    (tmp_path / "sure.tex").write_text(text_of(client, "tex", "?intervals=1&columns=mid"), encoding="utf-8")
    (tmp_path / "board.bib").write_text(text_of(client, "bib"), encoding="utf-8")
    (tmp_path / "paper.tex").write_text(
        r"\documentclass{article}\usepackage{booktabs}\begin{document}\tiny\input{plain}\par\input{sure}"
        r"\nocite{*}\bibliographystyle{plain}\bibliography{board}\end{document}"
    )
    for command in ([pdflatex], ["bibtex"], [pdflatex], [pdflatex]):
        options = ["-halt-on-error", "-interaction=nonstopmode"] if command == [pdflatex] else []
        done = subprocess.run(
            [*command, *options, "paper"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        assert done.returncode == 0, done.stdout[-3000:]
        assert "Warning--" not in done.stdout, done.stdout
    assert (tmp_path / "paper.pdf").stat().st_size > 10_000
    assert (tmp_path / "plain.tex").read_bytes().isascii()
