"""A submission's page: its line of state, its result, its problems, and who may see it."""

import random
from pathlib import Path
from uuid import uuid4

import pytest
from django.db.models import F
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries

from leaderboard import lifecycle, outcomes, submissions
from leaderboard.models import Edition, Evaluation, Submission, User
from tests import builders, pages

STATE = "/submissions/{}/state/"
PAGE = "/submissions/{}/"


@pytest.fixture
def signed_in(client: Client, owner: User) -> Client:
    client.force_login(owner)
    return client


@pytest.fixture
def submission(edition: Edition, owner: User) -> Submission:
    return builders.submit(owner, builders.predictions(edition))


def get(client: Client, address: str, submission: Submission, **query: str) -> pages.Element:
    response = client.get(address.format(submission.pk), query)
    assert response.status_code in {200, 286}
    return pages.page(response)


def current_step(root: pages.Element) -> str:
    (step,) = [li for li in root.one("ol", class_="steps").all("li") if "aria-current" in li.attributes]
    return step.text


def claim() -> lifecycle.Lease:
    (lease,) = lifecycle.claim(lease_s=60, wall_s=60)
    return lease


def strike_out(submission: Submission) -> None:
    """Let the worker die on it until it is given up."""
    for _ in range(lifecycle.MAX_POISON_STRIKES):
        Evaluation.objects.update(due_at=submission.submitted_at)
        lifecycle.give_back(
            claim(), strike=lifecycle.Strike.POISON, reason="the process died", rng=random.Random(0)
        )


def test_waiting_submission_says_its_place_and_keeps_asking(
    signed_in: Client, submission: Submission
) -> None:
    root = get(signed_in, PAGE, submission)
    assert current_step(root).startswith("Queued")
    assert "next in line" in current_step(root)
    state = root.one("div", id="state")
    assert state.attributes["hx-get"] == STATE.format(submission.pk)
    assert state.attributes["hx-trigger"].startswith("every ")
    assert state.attributes["aria-live"] == "polite"


def test_place_in_the_queue_counts_those_before(
    signed_in: Client, submission: Submission, edition: Edition, owner: User
) -> None:
    second = builders.submit(owner, builders.predictions(edition, factor=1.2))
    assert "1 ahead" in current_step(get(signed_in, PAGE, second))


def test_running_submission_says_since_when(signed_in: Client, submission: Submission) -> None:
    claim()
    root = get(signed_in, PAGE, submission)
    assert current_step(root).startswith("Running")
    assert len(root.one("ol", class_="steps").all("time")) == 3


def test_nothing_is_sent_while_nothing_moved(signed_in: Client, submission: Submission) -> None:
    seen = get(signed_in, PAGE, submission).one("input", name="seen").attributes["value"]
    same = signed_in.get(STATE.format(submission.pk), {"seen": seen})
    assert (same.status_code, same.content) == (204, b"")
    claim()
    moved = signed_in.get(STATE.format(submission.pk), {"seen": seen})
    assert moved.status_code == 200
    assert current_step(pages.page(moved)).startswith("Running")


def test_polling_goes_on_from_the_result_to_its_intervals_and_stops_there(
    signed_in: Client, submission: Submission
) -> None:
    seen = get(signed_in, PAGE, submission).one("input", name="seen").attributes["value"]
    builders.score_all()
    scored = signed_in.get(STATE.format(submission.pk), {"seen": seen})
    assert scored.status_code == 200
    fragment = pages.page(scored)
    assert current_step(fragment).startswith("Scored")
    assert current_step(fragment).endswith("intervals follow")
    outcome = fragment.one("div", id="outcome")
    assert outcome.attributes["hx-swap-oob"] == "innerHTML"
    assert len(outcome.one("div", class_="result").all("table")) == 2
    assert "Intervals are being computed." in outcome.text
    seen = fragment.one("input", name="seen").attributes["value"]
    assert signed_in.get(STATE.format(submission.pk), {"seen": seen}).status_code == 204
    builders.infer_all()
    last = signed_in.get(STATE.format(submission.pk), {"seen": seen})
    assert last.status_code == 286
    fragment = pages.page(last)
    assert "follow" not in current_step(fragment)
    assert "being computed" not in fragment.text
    assert intervals(fragment)


def intervals(root: pages.Element) -> list[str]:
    """What stands below those of the ten values that have enough recordings."""
    return [cell.text for cell in root.all("td", class_="span") if cell.text != "–"]


def test_page_of_a_result_without_intervals_yet_keeps_asking(
    signed_in: Client, submission: Submission
) -> None:
    builders.score_all()
    root = get(signed_in, PAGE, submission)
    assert root.one("div", id="state").attributes["hx-get"] == STATE.format(submission.pk)
    assert root.one("noscript").one("a").text == "look again"
    assert "moving" in root.one("li", **{"aria-current": "step"}).classes


def stops(client: Client, submission: Submission) -> str:
    """What a page says whose polling has come to its end, from whatever state it was in."""
    assert client.get(STATE.format(submission.pk), {"seen": "SCORED"}).status_code == 286
    root = get(client, PAGE, submission)
    assert "hx-get" not in root.one("div", id="state").attributes
    assert root.all("script") == []
    return root.one("main").text


def test_final_page_asks_for_nothing_more(signed_in: Client, submission: Submission) -> None:
    builders.score_all()
    builders.infer_all()
    assert "no intervals" not in stops(signed_in, submission)


def test_polling_ends_though_no_worker_ever_makes_intervals(
    signed_in: Client, submission: Submission
) -> None:
    builders.score_all()
    seen = get(signed_in, PAGE, submission).one("input", name="seen").attributes["value"]
    Evaluation.objects.update(finished_at=F("finished_at") - outcomes.AWAITED_FOR)
    assert signed_in.get(STATE.format(submission.pk), {"seen": seen}).status_code == 286
    assert "There are no intervals yet" in stops(signed_in, submission)


def test_polling_ends_at_once_where_there_are_too_few_recordings(
    signed_in: Client, benchmark: None, owner: User, tmp_path: Path
) -> None:
    few = builders.import_truth(tmp_path, n_recordings=6)
    sent = builders.submit(owner, builders.predictions(few))
    builders.score_all()
    assert "too few recordings (effective number 6.0; at least 8 needed)" in stops(signed_in, sent)


def test_polling_ends_at_once_for_what_was_withdrawn(
    signed_in: Client, submission: Submission, owner: User
) -> None:
    builders.score_all()
    submissions.withdraw(submission=submission, actor=owner, now=timezone.now())
    assert "intervals" not in stops(signed_in, submission)


def test_a_private_result_gets_intervals_as_well(signed_in: Client, edition: Edition, owner: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    builders.score_all()
    builders.infer_all()
    stops(signed_in, sent)
    assert intervals(get(signed_in, PAGE, sent))


def test_result_has_the_papers_columns_the_counts_and_the_truncations(
    signed_in: Client, submission: Submission
) -> None:
    builders.score_all()
    root = get(signed_in, PAGE, submission)
    mid, rte = root.one("div", class_="result").all("table")
    for half, symbol in ((mid, "MiD"), (rte, "RTE")):
        heads = [head.all("span")[0].text for head in half.one("thead").all("th")]
        assert heads == [symbol, *(f"{symbol}{letter}" for letter in "csln")]
    scores = {f"{s.metric}-{s.interval}": f"{s.value:.1f}" for s in submission.evaluations.get().scores.all()}
    values, counts = ([cell.text for cell in row.all("td")] for row in mid.one("tbody").all("tr"))
    names = ("overall", "crucial", "small", "large", "negative")
    # A value may be followed by its mark.
    assert [value.split()[0] for value in values] == [scores[f"mid-{i}"] for i in names]
    assert counts[0] == str(builders.N_SEQUENCES)
    assert "truncated" in root.one("main").text
    assert "1 sequence with |τ| > 20 s counts in the overall means only" in root.one("main").text


def test_problems_are_numbered_with_place_and_total(signed_in: Client, edition: Edition, owner: User) -> None:
    bad = builders.submit(owner, b'{"0": 0, "1": "fast", "zz": 1}')
    builders.score_all()
    root = get(signed_in, PAGE, bad)
    evaluation = bad.evaluations.get()
    assert current_step(root).startswith("Rejected")
    assert f"{evaluation.n_problems} problems in the file" in root.one("main").text
    items = root.one("ol", class_="problems").all("li")
    assert len(items) == len(evaluation.problems)
    for item, problem in zip(items, evaluation.problems, strict=True):
        assert problem["message"] in item.text
        assert problem["where"] in item.text


def test_list_of_problems_ends_after_twenty_points(signed_in: Client, edition: Edition, owner: User) -> None:
    values = [*['"fast"'] * 25, "NaN", *["1.0"] * (builders.N_SEQUENCES - 26)]
    text = ", ".join(f'"{i}": {value}' for i, value in enumerate(values))
    bad = builders.submit(owner, f"{{{text}}}".encode())
    builders.score_all()
    root = get(signed_in, PAGE, bad)
    assert "26 problems in the file" in root.one("main").text
    assert len(root.one("ol", class_="problems").all("li")) == 20
    assert "at most 20 points are listed" in root.one("main").text


def test_problems_page_shows_how_to_check_locally(signed_in: Client, edition: Edition, owner: User) -> None:
    bad = builders.submit(owner, b"[]")
    builders.score_all()
    root = get(signed_in, PAGE, bad)
    assert "tsttc check predictions.json --manifest tsttc-test-manifest.csv" in root.one("pre").text
    assert "/api/v1/splits/test/manifest" in [a.attributes["href"] for a in root.all("a")]


def test_problems_quote_hostile_keys_as_text(signed_in: Client, edition: Edition, owner: User) -> None:
    bad = builders.submit(owner, b'{"<script>alert(1)</script>": 1}')
    builders.score_all()
    root = get(signed_in, PAGE, bad)
    assert "<script>" in root.one("ol", class_="problems").text
    assert root.all("script") == []


def test_our_own_failure_is_called_ours(signed_in: Client, submission: Submission) -> None:
    strike_out(submission)
    root = get(signed_in, PAGE, submission)
    assert "by our fault" in current_step(root)
    assert "It was our fault" in root.one("main").text
    assert "You need not send it again" in root.one("main").text
    assert "this run costs no quota" in root.one("main").text


def test_cancelled_submission_says_so(signed_in: Client, submission: Submission, owner: User) -> None:
    lifecycle.cancel(submission=submission, actor=owner)
    root = get(signed_in, PAGE, submission)
    assert current_step(root).startswith("Cancelled")
    assert "cancelled before it was scored" in root.one("main").text


def test_without_script_the_page_offers_to_look_again(signed_in: Client, submission: Submission) -> None:
    link = get(signed_in, PAGE, submission).one("noscript").one("a")
    assert link.attributes["href"] == PAGE.format(submission.pk)


@pytest.mark.parametrize("address", [PAGE, STATE])
def test_strangers_cannot_tell_it_from_nothing(
    client: Client, submission: Submission, stranger: User, address: str
) -> None:
    client.force_login(stranger)
    there, nowhere = (client.get(address.format(pk)) for pk in (submission.pk, uuid4()))
    assert there.status_code == nowhere.status_code == 404
    assert without_tokens(there.content) == without_tokens(nowhere.content)


def without_tokens(content: bytes) -> list[bytes]:
    """The page without its form's token, which is masked anew for every answer."""
    return [line for line in content.splitlines() if b"csrfmiddlewaretoken" not in line]


@pytest.mark.parametrize("address", [PAGE, STATE])
def test_visitors_are_asked_to_sign_in(client: Client, submission: Submission, address: str) -> None:
    response = client.get(address.format(submission.pk))
    assert response.status_code == 302
    assert response.headers["Location"].startswith("/accounts/login/?next=/submissions/")


@pytest.mark.parametrize("who", ["teammate", "maintainer"])
def test_teammates_and_maintainers_see_it(
    client: Client, submission: Submission, who: str, request: pytest.FixtureRequest
) -> None:
    client.force_login(request.getfixturevalue(who))
    assert client.get(PAGE.format(submission.pk)).status_code == 200


def test_page_is_never_stored_by_caches(signed_in: Client, submission: Submission) -> None:
    response = signed_in.get(PAGE.format(submission.pk))
    assert {"no-store", "private"} <= set(response.headers["Cache-Control"].split(", "))


def test_list_has_my_teams_submissions_with_state_and_errors(
    signed_in: Client, edition: Edition, owner: User, teammate: User, stranger: User
) -> None:
    scored = builders.submit(owner, builders.predictions(edition), method="Scored one")
    builders.submit(teammate, b"[]", method="Bad one")
    builders.submit(stranger, builders.predictions(edition), method="Foreign one")
    builders.score_all()
    builders.submit(owner, builders.predictions(edition, factor=1.3), method="Waiting one")
    rows = [
        [cell.text for cell in row.all("td")]
        for row in pages.page(signed_in.get("/submissions/")).one("tbody").all("tr")
    ]
    assert [row[1] for row in rows] == ["Waiting one", "Bad one", "Scored one"]
    assert [row[3] for row in rows] == ["queued", "rejected", "scored"]
    mid = scored.evaluations.get().scores.get(metric="mid", interval="overall").value
    assert [row[4] for row in rows] == ["–", "–", f"{mid:.1f}"]


def test_maintainers_list_is_their_own_teams(
    client: Client, submission: Submission, maintainer: User
) -> None:
    client.force_login(maintainer)
    assert "Nothing has been submitted yet" in pages.page(client.get("/submissions/")).one("main").text


def test_empty_list_says_what_to_do(signed_in: Client, benchmark: None) -> None:
    main = pages.page(signed_in.get("/submissions/")).one("main")
    assert "Nothing has been submitted yet" in main.text
    assert "/submit/" in [a.attributes["href"] for a in main.all("a")]


def test_number_of_queries_does_not_grow_with_the_list(
    signed_in: Client, edition: Edition, owner: User, django_assert_max_num_queries: DjangoAssertNumQueries
) -> None:
    for i in range(5):
        builders.submit(owner, builders.predictions(edition, factor=1.1 + i / 10))
    builders.score_all()
    with django_assert_max_num_queries(9):
        signed_in.get("/submissions/")


def test_long_lists_come_in_pages(
    signed_in: Client, edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("leaderboard.web.views.PER_PAGE", 2)
    for i in range(3):
        builders.submit(owner, builders.predictions(edition, factor=1.1 + i / 10))
    root = pages.page(signed_in.get("/submissions/"))
    assert len(root.one("tbody").all("tr")) == 2
    assert root.one("nav", class_="pages").one("a").attributes["href"] == "?page=2"
    assert len(pages.page(signed_in.get("/submissions/?page=2")).one("tbody").all("tr")) == 1
    assert signed_in.get("/submissions/?page=nonsense").status_code == 200
