"""The queue as maintainers see it: what failed by our fault, what runs, what waits, and retrying."""

from datetime import timedelta
from uuid import UUID

import pytest
from django.http import HttpResponseBase
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries

from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    Method,
    Status,
    Submission,
    SweepBeat,
    User,
    Visibility,
)
from leaderboard.ops import health
from leaderboard.web.maintain import queue_tables
from tests import builders, pages
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.desk import get, main_text
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow

QUEUE, STATE, RETRY = "/maintain/queue/", "/maintain/queue/state/", "/maintain/queue/retry/"
REASON = 'signal 9 at <script>alert("x")</script>'


def fail(evaluation: Evaluation) -> Evaluation:
    """Let an evaluation that is the next in line strike out."""
    queue_rows.strike_out(reason=REASON)
    evaluation.refresh_from_db()
    assert evaluation.status == Status.SYSTEM_ERROR
    return evaluation


@pytest.fixture
def failed(edition: Edition, owner: User) -> Evaluation:
    return fail(queue_rows.queued(edition, owner))


@pytest.fixture
def all_three(failed: Evaluation, edition: Edition, owner: User) -> tuple[Evaluation, Evaluation, Evaluation]:
    """One that failed, one that runs, one that waits."""
    running = queue_rows.queued(edition, owner)
    queue_rows.claim()
    waiting = queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    return failed, running, waiting


def counts(root: pages.Element) -> list[str]:
    return [div.one("dd").text for div in root.one("dl", class_="totals").all("div")]


def rows(root: pages.Element, heading: str) -> list[list[str]]:
    """Return the rows of one list as texts; none where it is not shown."""
    shown = [each for each in root.all("section") if each.one("h2").text.startswith(heading)]
    assert len(shown) < 2
    return [[cell.text for cell in row.all("td")] for each in shown for row in each.one("tbody").all("tr")]


def retry(client: Client, *evaluations: Evaluation | UUID, query: str = "") -> HttpResponseBase:
    chosen = [str(each.pk if isinstance(each, Evaluation) else each) for each in evaluations]
    return client.post(f"{RETRY}{query}", {"evaluation": chosen}, follow=True)


# --- what is shown ---------------------------------------------------------------------------------------


def test_empty_queue_is_one_line_and_a_chosen_list_has_its_own(keeper: Client, edition: Edition) -> None:
    root = get(keeper, QUEUE)
    assert not root.all("section")
    assert not root.all("dl", class_="totals")
    assert "Nothing is waiting, running or failed." in root.one("main").text
    assert "No evaluation has finished yet." in root.one("main").text
    states = {"failed": "system errors", "running": "running evaluations", "waiting": "waiting evaluations"}
    for state, words in states.items():
        text = main_text(keeper, f"{QUEUE}?state={state}")
        assert f"No {words}." in text
        assert "Nothing is waiting" not in text


def test_page_says_when_the_last_evaluation_finished_and_whether_a_worker_lives(
    keeper: Client, edition: Edition, owner: User
) -> None:
    seen_lately = "A worker was seen in the last 60 s."
    assert seen_lately not in main_text(keeper, QUEUE)
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    finished_at = Evaluation.objects.get().finished_at
    assert finished_at is not None
    health.record_sweep()
    assert f"{seen_lately} The last evaluation finished at {finished_at:%Y-%m-%d %H:%M} UTC." in main_text(
        keeper, QUEUE
    )
    assert "No evaluation has finished yet." in main_text(keeper, f"{QUEUE}?split=val")


def test_what_failed_says_why_when_and_after_how_many_tries(keeper: Client, failed: Evaluation) -> None:
    [row] = rows(get(keeper, QUEUE), "System errors")
    assert failed.finished_at is not None
    assert row[0] == f"{failed.finished_at:%Y-%m-%d %H:%M} UTC"
    method = "Foo private Owls, owner@example.org"
    assert row[1:7] == [method, "Test, edition 1", "live", "3", "3 of 3 (file)", REASON]


def test_what_runs_says_who_holds_it_and_until_when(keeper: Client, edition: Edition, owner: User) -> None:
    running = queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    running.refresh_from_db()
    assert running.leased_until is not None
    [row] = rows(get(keeper, QUEUE), "Running")
    assert row[-2:] == [str(lease.token)[:8], f"{running.leased_until:%H:%M:%S}"]
    queue_rows.expire(lease)
    [row] = rows(get(keeper, QUEUE), "Running")
    assert row[-1] == "expired"


def test_no_page_tells_a_whole_lease(keeper: Client, edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    for address in (QUEUE, STATE, f"{QUEUE}?state=running"):
        page = keeper.get(address)
        assert str(lease.token)[:8] in page.text
        assert str(lease.token)[:13] not in page.text
        assert lease.token.hex not in page.text


def test_what_waits_after_a_strike_says_when_it_is_due_and_what_ended_it(
    keeper: Client, edition: Edition, owner: User
) -> None:
    waiting = queue_rows.queued(edition, owner)
    [row] = rows(get(keeper, QUEUE), "Waiting")
    assert row[-5:] == ["live", "0", "–", "now", "–"]
    queue_rows.give_back(queue_rows.claim())
    due_at = timezone.now() + timedelta(seconds=40)
    Evaluation.objects.filter(pk=waiting.pk).update(due_at=due_at)
    [row] = rows(get(keeper, QUEUE), "Waiting")
    assert row[-4:] == ["1", "1 of 10 (system)", f"{due_at:%H:%M:%S}", "the disk failed"]


def test_rows_say_what_makes_them_matter_less(keeper: Client, failed: Evaluation) -> None:
    Method.objects.update(visibility=Visibility.PUBLIC, shown_at=timezone.now())
    assert rows(get(keeper, QUEUE), "System errors")[0][1] == "Foo Owls, owner@example.org"
    Submission.objects.update(withdrawn_at=timezone.now())
    Edition.objects.update(published_at=None, discarded_at=timezone.now())
    assert rows(get(keeper, QUEUE), "System errors")[0][1].startswith("Foo withdrawn, edition discarded Owls")


def test_page_says_that_nobody_looks_after_the_queue(keeper: Client, edition: Edition) -> None:
    gone = "No worker was seen in the last 60 s: nothing is evaluated."
    assert gone in main_text(keeper, QUEUE)
    health.record_sweep(n_out_of_reach=2)
    text = main_text(keeper, QUEUE)
    assert gone not in text
    assert "2 waiting evaluations need a ground truth that the worker of the last sweep" in text
    SweepBeat.objects.update(swept_at=timezone.now() - timedelta(seconds=61))
    assert gone in main_text(keeper, QUEUE)


# --- one list, page by page ------------------------------------------------------------------------------


def test_lists_are_cut_and_lead_to_their_pages(
    keeper: Client, edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(queue_tables, "PER_SECTION", 2)
    monkeypatch.setattr(queue_tables, "PER_PAGE", 3)
    for _ in range(5):
        queue_rows.queued(edition, owner)
    root = get(keeper, QUEUE)
    assert len(rows(root, "Waiting")) == 2
    link = next(a for a in root.all("a") if a.text == "All 5")
    assert link.attributes["href"] == f"{QUEUE}?state=waiting"
    first = get(keeper, link.attributes["href"])
    assert len(rows(first, "Waiting")) == 3
    assert "page 1 of 2" in first.one("nav", class_="pages").text
    [onward] = first.one("nav", class_="pages").all("a")
    second = get(keeper, onward.attributes["href"])
    assert len(rows(second, "Waiting")) == 2
    assert second.one("div", id="queue").attributes["hx-get"] == f"{STATE}?state=waiting&page=2"


def test_lists_are_chosen_by_state_and_by_split(keeper: Client, all_three: object) -> None:
    root = get(keeper, f"{QUEUE}?state=running")
    assert [h2.text for h2 in root.all("h2")] == ["Running 1"]
    assert counts(root)[:3] == ["1", "1", "1"]
    assert "Nothing is waiting, running or failed." in main_text(keeper, f"{QUEUE}?split=val")
    assert counts(get(keeper, f"{QUEUE}?split=test"))[:3] == ["1", "1", "1"]
    links = [
        a.attributes["href"] for a in get(keeper, f"{QUEUE}?split=test").one("dl", class_="totals").all("a")
    ]
    assert links == [f"{QUEUE}?state={name}&split=test" for name in ("failed", "running", "waiting")]


@pytest.mark.parametrize("query", ["state=nothing", "split=nowhere", "state=%00"])
def test_what_cannot_be_asked_for_has_a_reason_at_its_field(
    keeper: Client, edition: Edition, query: str
) -> None:
    answer = keeper.get(f"{QUEUE}?{query}")
    assert answer.status_code == 400
    assert "There is no such" in assert_sound(answer).one("div", class_="wrong").text
    assert keeper.get(f"{STATE}?{query}").status_code == 400


# --- it moves by itself ----------------------------------------------------------------------------------


def seen(root: pages.Element) -> str:
    return root.one("input", id="queue-seen").attributes["value"]


def test_waiting_page_gets_what_is_new_and_nothing_else(
    keeper: Client, edition: Edition, owner: User
) -> None:
    health.record_sweep()
    root = get(keeper, QUEUE)
    asks = root.one("div", id="queue").attributes
    assert (asks["hx-get"], asks["hx-include"]) == (STATE, "#queue-seen")
    assert keeper.get(f"{STATE}?seen={seen(root)}").status_code == 204
    queue_rows.queued(edition, owner)
    news = keeper.get(f"{STATE}?seen={seen(root)}")
    assert news.status_code == 200
    fragment = pages.page(news)
    assert len(rows(fragment, "Waiting")) == 1
    queue_rows.claim()
    moved = pages.page(keeper.get(f"{STATE}?seen={seen(fragment)}"))
    assert (rows(moved, "Waiting"), len(rows(moved, "Running"))) == ([], 1)


# --- retrying --------------------------------------------------------------------------------------------


def test_retried_evaluation_waits_again_with_a_clean_slate_and_on_the_record(
    keeper: Client, failed: Evaluation, maintainer: User
) -> None:
    page = pages.page(retry(keeper, failed))
    assert "1 evaluation queued again." in page.one("main").text
    failed.refresh_from_db()
    assert (failed.status, failed.n_poison_strikes, failed.finished_at) == (Status.QUEUED, 0, None)
    event = AuditEvent.objects.get(verb="retried")
    assert (event.actor, event.noun, event.noun_id) == (maintainer, "Evaluation", str(failed.pk))
    assert event.details == {"reason": "from the queue"}


def test_buttons_send_what_they_stand_beside_and_come_back_to_the_same_list(
    keeper: Client, edition: Edition, owner: User
) -> None:
    both = [fail(queue_rows.queued(edition, owner)) for _ in range(2)]
    root = get(keeper, f"{QUEUE}?state=failed&split=test")
    forms = [form for form in root.one("main").all("form") if form.attributes["method"] == "post"]
    assert len(forms) == 3
    assert {form.attributes["action"] for form in forms} == {f"{RETRY}?state=failed&split=test"}
    sent = [{field.attributes["value"] for field in form.all("input", name="evaluation")} for form in forms]
    assert sent[0] == {str(each.pk) for each in both} == sent[1] | sent[2]
    answer = retry(keeper, *both, query="?state=failed&split=test")
    assert answer.redirect_chain == [(f"{QUEUE}?state=failed&split=test", 302)]  # type: ignore[attr-defined]  # of a test client that followed
    assert "2 evaluations queued again." in pages.page(answer).one("main").text


def test_what_was_retried_meanwhile_has_a_reason_and_is_not_retried_twice(
    keeper: Client, failed: Evaluation
) -> None:
    retry(keeper, failed)
    again = pages.page(retry(keeper, failed)).one("main").text
    assert "there is nothing to retry" in again
    assert "queued again" not in again
    assert AuditEvent.objects.filter(verb="retried").count() == 1


@pytest.mark.parametrize("chosen", ["nonsense", str(UUID(int=7))])
def test_retrying_nothing_says_so_and_changes_nothing(
    keeper: Client, failed: Evaluation, chosen: str
) -> None:
    answer = keeper.post(RETRY, {"evaluation": [chosen]})
    assert answer.status_code == 422
    assert chosen in assert_sound(answer).one("div", class_="form-errors").text
    failed.refresh_from_db()
    assert failed.status == Status.SYSTEM_ERROR


# --- the hub and the price -------------------------------------------------------------------------------


def test_desk_says_what_the_queue_holds_and_leads_to_it(keeper: Client, all_three: object) -> None:
    root = get(keeper, "/maintain/")
    assert "3 evaluations, 1 system error, oldest " in root.one("main").text
    assert QUEUE in [a.attributes["href"] for a in root.one("main").all("a")]


def test_number_of_queries_does_not_grow_with_the_queue(
    keeper: Client,
    all_three: object,
    edition: Edition,
    owner: User,
    stranger: User,
    django_assert_max_num_queries: DjangoAssertNumQueries,
) -> None:
    with django_assert_max_num_queries(14) as before:
        keeper.get(QUEUE)
    for user in (owner, stranger) * 3:
        queue_rows.queued(edition, user)
    with django_assert_max_num_queries(len(before.captured_queries)):
        keeper.get(QUEUE)
