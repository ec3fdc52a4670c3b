"""The guides of `docs/` are pages of the site, with navigation and search, and their links lead somewhere."""

import pytest
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries

from leaderboard.models import Edition, Split
from leaderboard.web.docs import docs_views, guides, search
from tests import pages
from tests.leaderboard.web.test_every_page import assert_sound


@pytest.mark.slow
def test_every_guide_is_a_sound_page(client: Client, benchmark: None) -> None:
    for name in guides.files():
        root = assert_sound(client.get(f"/docs/{name}/"))
        assert root.one("h1").text == guides.guide(name).title


@pytest.mark.slow
def test_every_page_of_the_documentation_has_the_navigation_and_marks_where_one_is(
    client: Client, benchmark: None
) -> None:
    for address in ("/docs/", "/docs/researchers/", "/docs/api/", "/docs/scoring/"):
        nav = next(
            e for e in pages.get(client, address).all("nav") if e.attributes["aria-label"] == "Documentation"
        )
        assert [a.attributes["href"] for a in nav.all("a") if "aria-current" in a.attributes] == [address]
        n_open = sum("open" in group.attributes for group in nav.all("details"))
        assert n_open == (5 if address == "/docs/" else 1)
        listed = {a.attributes["href"] for a in nav.all("a")}
        assert {
            "/docs/researchers/",
            "/docs/api-guide/",
            "/docs/api/",
            "/docs/operations/",
            "/dist/",
        } <= listed


@pytest.mark.parametrize(
    ("address", "above"),
    [("/docs/adr/0002-the-database-is-the-queue/", "/docs/decisions/"), ("/docs/api/submit/", "/docs/api/")],
)
def test_a_page_that_the_navigation_does_not_list_marks_the_page_above_it(
    client: Client, address: str, above: str
) -> None:
    navs = pages.get(client, address).all("nav", **{"aria-label": "Documentation"})
    marked = [link for nav in navs for link in nav.all("a") if "aria-current" in link.attributes]
    assert [(link.attributes["href"], link.attributes["aria-current"]) for link in marked] == [
        (above, "true")
    ]


def test_the_address_of_a_guide_without_its_slash_leads_to_it_and_others_are_404(
    client: Client, benchmark: None
) -> None:
    assert client.get("/docs/researchers").headers["Location"] == "/docs/researchers/"
    for name in ("nowhere", "../settings", "adr", "_site", "index.md"):
        assert client.get(f"/docs/{name}/").status_code == 404


@pytest.mark.slow
def test_a_guide_asks_the_database_for_nothing_and_is_compressed(
    client: Client, django_assert_num_queries: DjangoAssertNumQueries, db: None
) -> None:
    for address in ("/docs/cli/", "/docs/api/board/", "/docs/search/?q=quota", "/docs/api/"):
        with django_assert_num_queries(0):
            answer = client.get(address, headers={"Accept-Encoding": "gzip"})
        assert answer.headers["Content-Encoding"] == "gzip"
        assert len(answer.content) < 30_000


def test_a_visitor_finds_the_empty_template_in_the_docs_and_a_way_on_from_a_missing_page(
    client: Client, edition: Edition
) -> None:
    docs = pages.get(client, "/docs/")
    assert docs.all("a", href="/submit/template/test.json") != []
    assert "A sequence at exactly 3 s or 6 s counts in two TTC ranges" in docs.text
    missing = pages.read(client.get("/nowhere/").text).one("main")
    assert missing.one("form").attributes["action"] == "/docs/search/"
    assert {"/board/test/", "/board/val/"} <= {a.attributes["href"] for a in missing.all("a")}


@pytest.mark.slow
def test_no_code_of_the_documentation_has_a_hat_which_only_equations_set_over_its_letter(
    client: Client, benchmark: None
) -> None:
    drawn = {name: pages.read(guides.guide(name).html) for name in guides.files()}
    drawn["docs"] = pages.get(client, "/docs/").one("main")
    hat = "\N{COMBINING CIRCUMFLEX ACCENT}"
    assert [name for name, root in drawn.items() for code in root.all("code") if hat in code.text] == []
    assert drawn["scoring"].all("math") != []


@pytest.mark.slow
def test_a_guide_links_public_pages_that_it_names_and_shows_the_address_of_the_site(
    client: Client, benchmark: None
) -> None:
    assert pages.get(client, "/docs/cli/").all("a", href="/dist/") != []
    assert "leaderboard.example.org" not in pages.get(client, "/docs/cli/").text
    drawn = pages.get(client, "/docs/maintainers/")
    assert [a for a in drawn.one("article").all("a") if a.attributes["href"].startswith("/maintain/")] == []


# --- search ----------------------------------------------------------------------------------------------


def search_hits(client: Client, query: str) -> list[tuple[str, str]]:
    """Return address and text of each hit on the search page."""
    root = assert_sound(client.get("/docs/search/", {"q": query}, follow=True))
    items = [li for hits in root.all("ol", class_="hits") for li in hits.all("li")]
    return [(li.one("a").attributes["href"], li.text) for li in items]


@pytest.mark.parametrize(
    ("query", "address"),
    [
        ("quota", "/docs/access/#quotas"),
        ("how many files", "/docs/faq/#how-many-files-may-i-send"),
        ("how many files may I send", "/docs/access/#quotas"),
        ("how many submissions", "/docs/access/#quotas"),
        ("quota-exceeded", "/docs/problem-codes/#rates-and-quotas"),
        ("bootstr", "/docs/uncertainty/"),
        ("how to submit", "/docs/cli/#submit"),
        ("--fail-if", "/docs/cli/#submit"),
        ("looks-like-ratios", "/docs/file-format/#warnings"),
        ("how to get an API token", "/docs/access/#tokens"),
        ("what is an edition", "/docs/editions/"),
    ],
)
def test_what_people_look_for_is_among_the_first_five(
    client: Client, benchmark: None, query: str, address: str
) -> None:
    first = [href for href, _ in search_hits(client, query)[:5]]
    assert any(href.startswith(address) for href in first), first


def test_what_explains_a_word_comes_first_and_longer_words_with_its_beginning_last(
    client: Client, benchmark: None
) -> None:
    hits = search_hits(client, "quota")
    assert hits[0][0] == "/docs/access/#quotas"
    assert not [text for _, text in hits[:5] if "quotation" in text]


@pytest.mark.parametrize("query", ["truncate", "truncated", "truncates", "truncation"])
def test_every_form_of_a_word_finds_the_part_that_explains_it(
    client: Client, benchmark: None, query: str
) -> None:
    assert "/docs/scoring/#protocols" in [href for href, _ in search_hits(client, query)[:3]]


def test_a_line_of_code_with_the_words_follows_the_beginning_of_its_part() -> None:
    (hit,) = [each for each in search.find("truncation") if each.address == "/docs/annotation/#the-output"]
    part = next(each for each in guides.guide("annotation").parts if each.heading.anchor == "the-output")
    beginning, _, line = hit.snippet.partition("… ")
    assert part.prose.startswith(beginning)
    assert line == "1,573 observations are <mark>truncated</mark>"


def test_a_list_of_results_that_was_cut_says_so(client: Client, benchmark: None) -> None:
    assert "The 12 best results" in client.get("/docs/search/?q=quota").text
    n_hits = len(search.find("systemd"))
    assert 1 < n_hits < search.MAX_HITS
    assert f"{n_hits} results" in client.get("/docs/search/?q=systemd").text


def test_the_words_asked_for_are_marked_and_are_never_markup(client: Client, benchmark: None) -> None:
    assert "<mark>quota</mark>" in client.get("/docs/search/?q=quota").text
    for query in ("<script>alert(1)</script>", '"><img src=x>', "\x00", "%", "(" * 50):
        answer = client.get("/docs/search/", {"q": query})
        assert answer.status_code == 200
        assert "<script>alert" not in answer.text
        assert "<img src=x" not in answer.text


def test_the_first_page_names_a_split_that_is_open_or_says_that_none_is(
    client: Client, benchmark: None, edition: Edition
) -> None:
    def commands() -> str:
        root = pages.get(client, "/docs/")
        hrefs = [a.attributes["href"] for a in root.one("article").all("a")]
        asked = [href for href in hrefs if "/api/v1/splits/" in href]
        for href in asked:
            answer = client.get(href)
            assert answer.status_code == 200
            assert answer.getvalue()
        return root.one("article").text

    assert "--split test --method" in commands()
    Split.objects.filter(pk="test").update(closes_at=timezone.now())
    assert "No split is open for submissions now (dates)." in commands()
    Split.objects.update(current_edition=None)
    assert "; replace SPLIT with the name of one that is" in commands()
    assert "--split SPLIT --method" in commands()


def test_where_no_part_has_all_words_those_with_some_are_shown() -> None:
    assert search.find("quota xyzzyq")
    assert search.find("quota-xyzzyq") == search.find("quota xyzzyq")
    assert search.find("xyzzyq") == []


@pytest.mark.slow
def test_the_first_eight_words_of_a_search_count_however_they_are_joined() -> None:
    names = [f"quota{n}" for n in range(search.MAX_WORDS)]
    for joint in (" ", "-", "_"):
        assert search.find(joint.join([*names, "edition", "board"])) == search.find(" ".join(names)) == []
    assert search.find("edition " + " ".join(names)) != []
    # Each word of a search is looked for in every part: this one would be 43 words, and then 43 again.
    assert search.find("-".join("abcdefghijklmnopqrstuvwxyz")) == search.find("a b c") == []


def test_a_search_too_many_at_once_is_refused_and_leaves_threads_for_others(
    client: Client, benchmark: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    statuses: list[int] = []

    def meanwhile(query: str) -> list[search.Hit]:
        statuses.append(client.get(f"/docs/search/?q={query}").status_code)
        return []

    monkeypatch.setattr(search, "find", meanwhile)
    answer = client.get("/docs/search/?q=quota")
    assert statuses == [429] + [200] * (docs_views.SEARCHES_AT_ONCE - 1)
    assert (answer.status_code, statuses[0]) == (200, 429)
    monkeypatch.undo()
    assert client.get("/docs/search/?q=quota").status_code == 200


@pytest.mark.slow
def test_a_page_of_several_sections_lists_them_and_each_link_has_its_heading(
    client: Client, benchmark: None
) -> None:
    for address in ("/docs/", "/docs/api/", "/docs/api/board/", "/docs/scoring/", "/docs/cli/"):
        page = pages.get(client, address)
        nav = next(e for e in page.all("nav") if e.attributes["aria-label"] == "On this page")
        listed = [a.attributes["href"].removeprefix("#") for a in nav.all("a")]
        ids = [e.attributes["id"] for e in page.everything() if "id" in e.attributes]
        assert [ids.count(name) for name in listed] == [1] * len(listed)
        assert {e.attributes["id"] for e in page.all("h2")} - {"operations"} <= set(listed)


def test_decisions_follow_their_list_and_each_other() -> None:
    decisions = sorted(name for name in guides.files() if name.startswith("adr/"))
    before, after = guides.neighbours(decisions[0])
    assert before
    assert after
    assert (before.name, after.name) == ("decisions", decisions[1])
    assert guides.neighbours(decisions[-1])[1] is None
