"""No two names on the boards look alike: of public methods, of rows of papers, and at the same moment."""

from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction
from django.utils import timezone

from evaluator import get_protocol
from leaderboard.editions import splits
from leaderboard.errors.refusals import Refused
from leaderboard.methods import visibility
from leaderboard.models import Edition, Method, PublishedResult, User
from leaderboard.moderation import hiding
from leaderboard.people import teams
from leaderboard.people.names import skeleton

pytestmark = pytest.mark.slow
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
