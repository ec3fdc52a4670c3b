"""A submission's page: its line of state, its result, its problems, and who may see it."""

import random
from datetime import timedelta
from pathlib import Path

import pytest
from django.db.models import F
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Evaluation, Submission, User
from leaderboard.queue import lifecycle
from leaderboard.submissions import outcomes
from tests import builders, pages
from tests.editions import corrected, open_edition, publish

pytestmark = pytest.mark.slow

STATE = "/submissions/{}/state/"
PAGE = "/submissions/{}/"


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
        lifecycle.fail_attempt(
            claim(), strike=lifecycle.Strike.POISON, reason="the process died", rng=random.Random(0)
        )


def test_waiting_submission_shows_its_position_and_keeps_asking(
    signed_in: Client, submission: Submission
) -> None:
    root = get(signed_in, PAGE, submission)
    assert current_step(root).startswith("Queued")
    assert "next in line" in current_step(root)
    state = root.one("div", id="state")
    assert state.attributes["hx-get"] == STATE.format(submission.pk)
    assert state.attributes["hx-trigger"].startswith("every ")
    assert state.attributes["aria-live"] == "polite"


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
    assert current_step(fragment).endswith("confidence intervals follow")
    outcome = fragment.one("div", id="outcome")
    assert outcome.attributes["hx-swap-oob"] == "innerHTML"
    assert len(outcome.one("div", class_="result").one("tbody").all("tr")) == 5
    assert "The confidence intervals are being computed." in outcome.text
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
    """Return the intervals of those of the ten values that have enough recordings."""
    return [cell.text for cell in root.all("td", class_="span") if cell.text != "–"]


def stops(client: Client, submission: Submission) -> str:
    """Return the text of a page whose polling has ended."""
    assert client.get(STATE.format(submission.pk), {"seen": "SCORED"}).status_code == 286
    root = get(client, PAGE, submission)
    assert "hx-get" not in root.one("div", id="state").attributes
    assert root.one("main").all("script") == []
    return root.one("main").text


def test_polling_ends_though_no_worker_ever_makes_intervals(
    signed_in: Client, submission: Submission
) -> None:
    builders.score_all()
    seen = get(signed_in, PAGE, submission).one("input", name="seen").attributes["value"]
    Evaluation.objects.update(finished_at=F("finished_at") - outcomes.AWAITED_FOR)
    assert signed_in.get(STATE.format(submission.pk), {"seen": seen}).status_code == 286
    assert "There are no confidence intervals yet" in stops(signed_in, submission)


def test_result_has_the_papers_columns_the_counts_and_the_truncations(
    signed_in: Client, submission: Submission
) -> None:
    builders.score_all()
    root = get(signed_in, PAGE, submission)
    table = root.one("div", class_="result").one("table")
    heads = [head.text for head in table.one("thead").all("th")]
    assert heads == ["TTC range", "MiD ×10⁻⁴", "RTE %", "Sequences"]
    scores = {
        f"{s.metric}-{s.ttc_range}": f"{s.value:.1f}" for s in submission.evaluations.get().scores.all()
    }
    rows = table.one("tbody").all("tr")
    names = [row.one("th").text.split()[-1] for row in rows]
    assert names == ["overall", "crucial", "small", "large", "negative"]
    for name, row in zip(names, rows, strict=True):
        # A value may be followed by its mark.
        values = [cell.text.split()[0] for cell in row.all("td", class_="score")]
        assert values == [scores[f"mid-{name}"], scores[f"rte-{name}"]]
    assert rows[0].one("td", class_="count").text == str(builders.N_SEQUENCES)
    assert "truncated" in root.one("main").text
    assert (
        "1 sequence lies outside all TTC ranges and counts only towards the overall scores"
        in root.one("main").text
    )


def test_problems_are_numbered_with_position_and_total(
    signed_in: Client, edition: Edition, owner: User
) -> None:
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
        # People read the key, programs the pointer.
        assert problem["where"].rpartition("/")[2].replace("~1", "/") in item.text


def test_our_own_failure_is_called_ours(signed_in: Client, submission: Submission) -> None:
    strike_out(submission)
    root = get(signed_in, PAGE, submission)
    assert "System error" in current_step(root)
    assert "error on our side" in root.one("main").text
    assert "you don’t need to submit it again" in root.one("main").text
    assert "it does not count against your quota" in root.one("main").text


def test_one_that_waits_far_too_long_says_so_and_that_nothing_is_lost(
    signed_in: Client, submission: Submission
) -> None:
    before = get(signed_in, PAGE, submission).one("input", name="seen").attributes["value"]
    late = F("queued_at") - timedelta(minutes=5)
    Evaluation.objects.update(queued_at=late)
    answer = signed_in.get(STATE.format(submission.pk), {"seen": before})
    assert current_step(pages.page(answer)).endswith("Taking longer than usual; nothing is lost.")
    claim()
    assert "nothing is lost" in current_step(get(signed_in, PAGE, submission))


def test_of_a_re_scored_submission_both_runs_are_shown_with_their_dates(
    signed_in: Client, submission: Submission, tmp_path: Path
) -> None:
    builders.score_all()
    long_ago = timezone.now() - timedelta(days=100)
    Submission.objects.update(submitted_at=long_ago)
    Evaluation.objects.update(finished_at=long_ago)
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    steps = get(signed_in, PAGE, submission).one("ol", class_="steps").all("li")
    again_at = Evaluation.objects.get(edition=second).finished_at
    day, today = f"{long_ago:%Y-%m-%d}", f"{again_at:%Y-%m-%d}"
    assert [step.one("span", class_="label").text for step in steps] == ["Received", "Scored", "Re-scored"]
    assert [step.one("time").text[:10] for step in steps] == [day, day, today]
    assert all(step.one("time").text.endswith(" UTC") for step in steps)
    assert steps[1].text.endswith("edition 1")
    assert "edition 2" in steps[2].text
    # The run in the first edition had failed, and was retried only now.
    Evaluation.objects.exclude(edition=second).update(finished_at=again_at + timedelta(minutes=1))
    steps = get(signed_in, PAGE, submission).one("ol", class_="steps").all("li")
    times = [step.one("time").text for step in steps]
    assert times == sorted(times)
    assert [step.one("span", class_="label").text for step in steps][-1] == "Scored"


def test_after_the_score_the_next_steps_are_buttons(signed_in: Client, edition: Edition, owner: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    builders.score_all()
    main = get(signed_in, PAGE, sent).one("main")
    assert [a.text for a in main.one("p", class_="next").all("a")] == ["Publish…", "Signed receipt"]
    assert main.one("code", id="latex-row").text
    copied = {button.attributes["data-copy"] for button in main.all("button", class_="copy")}
    assert copied == {"citation", "citation-latex", "latex-row", "digest"}
