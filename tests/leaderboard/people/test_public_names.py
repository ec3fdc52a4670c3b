"""No two names on the boards look alike: of public methods, of rows of papers, and at the same moment."""

import uuid
from collections.abc import Sequence
from contextlib import redirect_stdout
from datetime import timedelta
from io import StringIO

import pytest
from django.db import IntegrityError, connection, transaction
from django.db.migrations.executor import MigrationExecutor
from django.test import Client
from django.utils import timezone

from evaluator import get_protocol
from leaderboard.editions import splits
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing, visibility
from leaderboard.models import Edition, Membership, Method, PublishedResult, Team, User
from leaderboard.moderation import hiding
from leaderboard.people import public_names, teams
from leaderboard.people.names import skeleton

NOW = timezone.now


def method(user: User, name: str) -> Method:
    return Method.objects.create(team=teams.team_of(user=user), name=name)


def show(row: Method, user: User) -> Method:
    return visibility.change(method=row, visibility="PUBLIC", actor=user, now=NOW())


def test_the_database_itself_keeps_public_methods_apart(owner: User, stranger: User) -> None:
    show(method(owner, "Owl Net"), owner)
    other = method(stranger, "Оwl‑Net.")
    with pytest.raises(Refused, match="looks like it"):
        show(other, stranger)
    assert Method.objects.get(visibility="PUBLIC").look == skeleton("Owl Net")
    assert Method.objects.get(pk=other.pk).look is None
    with pytest.raises(IntegrityError), transaction.atomic():
        Method.objects.filter(pk=other.pk).update(look=skeleton("Owl Net"))


def test_a_maintainer_gives_no_public_method_the_look_of_another_one(
    owner: User, stranger: User, maintainer: User
) -> None:
    first, second = show(method(owner, "Owls"), owner), show(method(stranger, "Hawks"), stranger)
    with pytest.raises(Refused, match="looks like it"):
        hiding.rename_method(method=second, name="“Owls”", reason="R", actor=maintainer, now=NOW())
    hiding.rename_method(method=first, name="Kites", reason="R", actor=maintainer, now=NOW())
    hiding.rename_method(method=second, name="“Owls”", reason="R", actor=maintainer, now=NOW())
    looks = set(Method.objects.values_list("look", flat=True))
    assert looks == {skeleton("Kites"), skeleton("Owls")}


def test_an_anonymous_method_gets_a_number_where_its_name_is_taken_by_then(
    owner: User, stranger: User
) -> None:
    row = method(owner, "Owls")
    visibility.change(
        method=row, visibility="ANONYMOUS", actor=owner, now=NOW(), reveal_at=NOW() + timedelta(days=1)
    )
    show(method(stranger, "(Owls)"), stranger)
    assert visibility.reveal_due(now=NOW() + timedelta(days=2)) == 1
    row.refresh_from_db()
    assert (row.name, row.look) == ("Owls 2", skeleton("Owls 2"))


# --- rows of papers -----------------------------------------------------------------------------------------


def document(*names: str, split: str = "test") -> dict[str, object]:
    scores = dict.fromkeys(get_protocol("tsttc-1").score_names, 1.0)
    return {
        "source": {"title": "T", "authors": "A", "table": "1", "url": "https://example.org", "year": 2024},
        "columns": list(scores),
        "methods": [{"slug": f"row-{i}", "name": name} for i, name in enumerate(names)],
        "results": {split: {f"row-{i}": list(scores.values()) for i, _ in enumerate(names)}},
    }


def quote(*names: str, **options: str) -> splits.Imported:
    return splits.import_published(document=document(*names, **options), now=NOW())


def test_a_document_with_two_rows_of_one_look_on_one_board_is_refused(edition: Edition) -> None:
    before = PublishedResult.objects.count()
    for names in (("Later", "Later"), ("Later", "“Later”"), ("Foo Lab", "Foo‑Lab")):
        with pytest.raises(Refused, match="looks like"):
            quote(*names)
    assert PublishedResult.objects.count() == before
    assert len(quote("Later", "Sooner").added) == 2
    assert len(quote("Later", "Sooner").unchanged) == 2
    assert len(quote("Later", split="val").added) == 1


def test_a_row_and_a_public_method_do_not_look_alike(edition: Edition, owner: User, stranger: User) -> None:
    show(method(owner, "Owls"), owner)
    with pytest.raises(Refused, match="looks like 'Owls'"):
        quote("Owls.")
    quote("Hawks")
    with pytest.raises(Refused, match="looks like it"):
        show(method(stranger, "Hawks!"), stranger)


# --- names from before looks were compared ------------------------------------------------------------------


def migrate_with(names: Sequence[str]) -> tuple[list[Team], list[Method], str]:
    """Let the migration find public teams and methods of these names, and a hidden team and method of each.

    Returns the public ones in the order in which they became public, and what the migration says.
    """
    executor = MigrationExecutor(connection)
    graph = executor.loader.graph
    [migration] = [key for key in graph.nodes if key[1].endswith("_looks_of_public_names")]
    before = [(parent[0], parent[1]) for parent in sorted(graph.node_map[migration].parents)]
    executor.migrate(before)
    teams_then: list[uuid.UUID] = []
    methods_then: list[uuid.UUID] = []
    try:
        old = executor.loader.project_state(before).apps
        team_table, method_table = (
            old.get_model("leaderboard", "Team"),
            old.get_model("leaderboard", "Method"),
        )
        for is_public in (True, False):
            for number, name in enumerate(names):
                at = NOW() - timedelta(days=number)
                team = team_table.objects.create(
                    name=name, look=name.casefold(), is_shown=is_public, created_at=at
                )
                row = method_table.objects.create(
                    team=team,
                    name=name,
                    visibility="PUBLIC" if is_public else "PRIVATE",
                    shown_at=at if is_public else None,
                )
                if is_public:
                    teams_then.insert(0, team.pk)
                    methods_then.insert(0, row.pk)
    finally:
        executor = MigrationExecutor(connection)
        with redirect_stdout(StringIO()) as said:
            executor.migrate(executor.loader.graph.leaf_nodes())
    return (
        [Team.objects.get(pk=pk) for pk in teams_then],
        [Method.objects.get(pk=pk) for pk in methods_then],
        said.getvalue(),
    )


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_of_names_that_look_alike_already_the_later_ones_are_exempt_until_they_are_renamed(
    maintainer: User, owner: User
) -> None:
    names = ["“Owls”", "Hawks", "Owls.", "Owls"]
    team_rows, method_rows, said = migrate_with(names)
    for rows, kind in ((team_rows, "teams"), (method_rows, "methods")):
        first, second, other, third = rows
        assert [row.name for row in rows] == names[::-1]
        assert (first.look, other.look) == (skeleton("Owls"), skeleton("Hawks"))
        assert [row.look for row in (second, third)] == [f"{first.look} {row.pk}" for row in (second, third)]
        for later in (second, third):
            pair = f"{first.name!r} ({first.pk}) and {later.name!r} ({later.pk}) look alike"
            assert f"The {kind} {pair}" in said
    assert len({line for line in said.splitlines() if "look alike" in line}) == 4
    # A list for maintainers, of the later ones alone.
    assert [each.row.name for each in public_names.exempt()] == ["Owls.", "“Owls”"] * 2
    client = Client()
    client.force_login(maintainer)
    page = client.get("/maintain/teams/").content.decode()
    table = page[page.index('id="alike"') :]
    assert table.count(">Owls.</a>") == table.count(">“Owls”</a>") == 2
    # Whatever else changes, the name stays; a new name must look different.
    for later in method_rows[1], method_rows[3]:
        Membership.objects.update_or_create(user=owner, defaults={"team": later.team, "is_owner": True})
        editing.edit(method=later, changes={"description": "D"}, actor=owner)
        with pytest.raises(Refused, match="looks like"):
            hiding.rename_method(method=later, name="(Owls)", reason="R", actor=maintainer, now=NOW())
        with pytest.raises(Refused, match="looks like"):
            teams.rename(team=later.team, name="(Owls)", actor=owner, now=NOW())
    hiding.rename_method(method=method_rows[1], name="Kites", reason="R", actor=maintainer, now=NOW())
    Membership.objects.update_or_create(user=owner, defaults={"team": team_rows[1], "is_owner": True})
    teams.rename(team=team_rows[1], name="Kites", actor=owner, now=NOW())
    assert [each.row.name for each in public_names.exempt()] == ["“Owls”"] * 2


@pytest.mark.django_db(transaction=True)
def test_names_with_badges_from_before_they_stopped_to_count_are_exempt_too(
    owner: User, stranger: User
) -> None:
    rows = [show(method(owner, "Owls"), owner), show(method(stranger, "Hawks"), stranger)]
    # As it was public then, with the look that it had.
    Method.objects.filter(pk=rows[1].pk).update(name="Owls ★", look="ovvls★")
    executor = MigrationExecutor(connection)
    [migration] = [key for key in executor.loader.graph.nodes if key[1].endswith("_looks_without_badges")]
    executor.migrate([(p[0], p[1]) for p in sorted(executor.loader.graph.node_map[migration].parents)])
    executor = MigrationExecutor(connection)
    with redirect_stdout(StringIO()) as said:
        executor.migrate(executor.loader.graph.leaf_nodes())
    assert "'Owls ★'" in said.getvalue()
    for row in rows:
        row.refresh_from_db()
    assert [row.look for row in rows] == [skeleton("Owls"), f"{skeleton('Owls')} {rows[1].pk}"]
    assert [(each.row.name, each.twin) for each in public_names.exempt()] == [("Owls ★", "Owls")]


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_an_exempt_name_stays_taken_when_the_first_one_is_renamed(
    maintainer: User, owner: User, stranger: User
) -> None:
    team_rows, method_rows, _ = migrate_with(["“Owls”", "Owls"])
    hiding.rename_method(method=method_rows[0], name="Kites", reason="R", actor=maintainer, now=NOW())
    Membership.objects.create(user=owner, team=team_rows[0], is_owner=True)
    teams.rename(team=team_rows[0], name="Kites", actor=owner, now=NOW())
    with pytest.raises(Refused, match="looks like"):
        teams.create(user=stranger, name="Owls", now=NOW())
    teams.create(user=stranger, name="Hawks", now=NOW())
    with pytest.raises(Refused, match="looks like"):
        show(method(stranger, "Owls"), stranger)
    assert [each.twin for each in public_names.exempt()] == [None, None]
