"""What a maintainer does to one team, method or submission happens to it alone."""

import pytest
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, Evaluation, Method, Status, Submission, Team, User
from leaderboard.moderation import hiding
from leaderboard.people import teams
from tests import builders

SPLITS = ("test", "val")


@pytest.fixture
def pair(edition: Edition, owner: User, stranger: User) -> tuple[Submission, Submission]:
    """Two teams with a public method each, waiting for their scores."""
    first = builders.submit(owner, builders.predictions(edition), method="First")
    second = builders.submit(stranger, builders.predictions(edition, factor=1.2), method="Second")
    return first, second


def withdraw(submission: Submission, keeper: User, *, is_hidden: bool = False) -> Submission:
    return hiding.withdraw_entry(
        submission=submission, reason="R", actor=keeper, now=timezone.now(), is_hidden=is_hidden
    )


def versions() -> dict[str, int]:
    return {name: board_versions.number_of(name) for name in SPLITS}


def raised(before: dict[str, int]) -> set[str]:
    """The splits whose boards are new since."""
    return {name for name in SPLITS if board_versions.number_of(name) > before[name]}


@pytest.mark.parametrize("is_hidden", [False, True])
def test_withdrawing_a_waiting_file_cancels_it_and_no_other(
    pair: tuple[Submission, Submission], maintainer: User, is_hidden: bool
) -> None:
    first, second = pair
    withdraw(first, maintainer, is_hidden=is_hidden)
    builders.score_all()
    assert Evaluation.objects.get(submission=first).status == Status.CANCELLED
    assert Evaluation.objects.get(submission=second).status == Status.SCORED
    second.refresh_from_db()
    assert second.withdrawn_at is None


def test_a_withdrawn_entry_keeps_its_place_and_time_when_it_is_hidden_later(
    pair: tuple[Submission, Submission], maintainer: User
) -> None:
    builders.score_all()
    withdrawn = withdraw(pair[0], maintainer)
    assert (withdrawn.withdrawn_at is not None, withdrawn.hidden_at) == (True, None)
    with pytest.raises(Refused, match="withdrawn already"):
        withdraw(pair[0], maintainer)
    hidden = withdraw(pair[0], maintainer, is_hidden=True)
    assert hidden.withdrawn_at == withdrawn.withdrawn_at
    assert hidden.hidden_at is not None
    with pytest.raises(Refused, match="withdrawn already"):
        withdraw(pair[0], maintainer, is_hidden=True)
    assert list(
        AuditEvent.objects.filter(verb__in=["withdrawn", "hidden"])
        .order_by("pk")
        .values_list("verb", flat=True)
    ) == ["withdrawn", "hidden"]


def test_withdrawing_an_entry_renews_the_board_of_its_split_alone(
    pair: tuple[Submission, Submission], maintainer: User
) -> None:
    before = versions()
    withdraw(pair[0], maintainer)
    assert raised(before) == {"test"}


def test_a_public_method_that_moves_makes_the_name_of_its_new_team_a_public_one(
    pair: tuple[Submission, Submission], maintainer: User
) -> None:
    newcomer = teams.team_of(user=User.objects.create_user("new@example.org", name="Herons"))
    hiding.move_method(method=pair[0].method, to=newcomer, reason="R", actor=maintainer)
    assert Team.objects.get(pk=newcomer.pk).is_shown
    lookalike = User.objects.create_user("like@example.org", name="Other")
    with pytest.raises(Refused, match="looks like"):
        teams.rename(team=teams.team_of(user=lookalike), name="Herons", actor=lookalike, now=timezone.now())


def test_a_private_method_that_moves_tells_no_name(edition: Edition, owner: User, maintainer: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    newcomer = teams.team_of(user=User.objects.create_user("new@example.org", name="Herons"))
    moved = hiding.move_method(method=sent.method, to=newcomer, reason="R", actor=maintainer)
    assert moved.team == newcomer
    assert not Team.objects.get(pk=newcomer.pk).is_shown


def test_a_method_moves_alone_and_not_to_where_it_is_or_its_name_is_taken(
    pair: tuple[Submission, Submission], edition: Edition, owner: User, maintainer: User
) -> None:
    first, second = pair
    other = builders.submit(owner, builders.predictions(edition, factor=1.3), method="Another").method
    with pytest.raises(Refused, match="in the team 'Owls' already"):
        hiding.move_method(method=first.method, to=first.method.team, reason="R", actor=maintainer)
    hiding.move_method(method=first.method, to=second.method.team, reason="R", actor=maintainer)
    assert {row.name: row.team.name for row in Method.objects.select_related("team")} == {
        "First": "Strangers", "Second": "Strangers", "Another": "Owls",
    }  # fmt: skip
    namesake = builders.submit(
        owner, builders.predictions(edition, factor=1.4), method="First", visibility="PRIVATE"
    ).method
    with pytest.raises(Refused, match="First"):
        hiding.move_method(method=namesake, to=second.method.team, reason="R", actor=maintainer)
    assert other.team == Method.objects.get(pk=other.pk).team


@pytest.mark.parametrize("what", ["team", "method", "texts", "moved"])
@pytest.mark.parametrize("is_public", [True, False])
def test_boards_are_new_where_a_public_name_has_changed(
    pair: tuple[Submission, Submission], maintainer: User, what: str, is_public: bool
) -> None:
    method = pair[0].method
    if not is_public:
        Method.objects.filter(pk=method.pk).update(visibility="PRIVATE")
    before, more = versions(), {"reason": "R", "actor": maintainer}
    if what == "team":
        hiding.rename_team(team=method.team, name="New", now=timezone.now(), **more)
    elif what == "method":
        hiding.rename_method(method=method, name="New", now=timezone.now(), **more)
    elif what == "texts":
        hiding.clear_texts(method=method, **more)
    else:
        hiding.move_method(method=method, to=pair[1].method.team, **more)
    assert raised(before) == ({"test"} if is_public else set())


def test_names_and_texts_of_other_teams_and_methods_stay(
    pair: tuple[Submission, Submission], maintainer: User
) -> None:
    Method.objects.update(
        description="D", paper_url="https://example.org/p", code_url="https://example.org/c"
    )
    first, now = pair[0].method, timezone.now()
    cleared = hiding.clear_texts(method=first, reason="R", actor=maintainer)
    assert (cleared, cleared.description) == (first, "")
    hiding.rename_method(method=first, name="New method", reason="R", actor=maintainer, now=now)
    hiding.rename_team(team=first.team, name="New team", reason="R", actor=maintainer, now=now)
    fields = ("name", "team__name", "description", "paper_url", "code_url")
    assert set(Method.objects.values_list(*fields)) == {
        ("New method", "New team", "", "", ""),
        ("Second", "Strangers", "D", "https://example.org/p", "https://example.org/c"),
    }


def test_a_public_name_that_is_taken_is_refused_and_a_private_one_may_look_like_it(
    pair: tuple[Submission, Submission], edition: Edition, owner: User, maintainer: User
) -> None:
    now = timezone.now()
    with pytest.raises(Refused, match="Second"):
        hiding.rename_method(method=pair[0].method, name="Second", reason="R", actor=maintainer, now=now)
    sent = builders.submit(
        owner, builders.predictions(edition, factor=1.3), method="Third", visibility="PRIVATE"
    )
    hiding.rename_method(method=sent.method, name="Second", reason="R", actor=maintainer, now=now)
    assert Method.objects.get(pk=sent.method_id).name == "Second"


@pytest.mark.parametrize(("name", "twin"), [("SECOND", "Second"), ("PRINTED", "Printed")])
def test_a_public_method_gets_no_name_that_looks_like_one_of_a_method_or_a_paper(
    pair: tuple[Submission, Submission], maintainer: User, name: str, twin: str
) -> None:
    builders.quote("Printed", {})
    with pytest.raises(Refused, match=f"already have a method '{twin}'") as caught:
        hiding.rename_method(
            method=pair[0].method, name=name, reason="R", actor=maintainer, now=timezone.now()
        )
    assert caught.value.field == "name"
    assert set(Method.objects.values_list("name", flat=True)) == {"First", "Second"}


def test_an_account_is_closed_and_opened_by_what_the_log_says(
    owner: User, stranger: User, maintainer: User
) -> None:
    for is_active, verb in ((False, "closed"), (True, "opened")):
        hiding.set_active(user=owner, is_active=is_active, reason="R", actor=maintainer)
        assert AuditEvent.objects.latest("pk").verb == verb
        assert User.objects.get(pk=owner.pk).is_active is is_active
        assert User.objects.get(pk=stranger.pk).is_active


def test_a_reason_of_the_longest_kind_is_taken_and_a_longer_one_refused(
    owner: User, maintainer: User
) -> None:
    hiding.set_active(user=owner, is_active=False, reason="x" * 500, actor=maintainer)
    with pytest.raises(Refused, match="500"):
        hiding.set_active(user=owner, is_active=True, reason="x" * 501, actor=maintainer)


def test_a_team_that_was_deleted_meanwhile_is_no_place_to_move_to(
    pair: tuple[Submission, Submission], maintainer: User
) -> None:
    gone = Team.objects.create(name="Gone", look="gone")
    Team.objects.filter(pk=gone.pk).delete()
    with pytest.raises(Refused, match="deleted a moment ago"):
        hiding.move_method(method=pair[0].method, to=gone, reason="R", actor=maintainer)
