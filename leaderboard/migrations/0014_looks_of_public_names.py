"""Public methods have a look, unique as that of teams, in which punctuation and spaces no longer count."""

import sys

from django.db import migrations, models

_SAID = (
    "The {kind} {first!r} ({first_id}) and {second!r} ({second_id}) look alike. Both keep their names; the second "
    "must look different once it is renamed.\n"
)


def give_looks(apps, schema_editor):
    from leaderboard.people.names import skeleton

    Team, Method = apps.get_model("leaderboard", "Team"), apps.get_model("leaderboard", "Method")
    hidden = Team.objects.filter(is_shown=False)
    for team in hidden.iterator():
        Team.objects.filter(pk=team.pk).update(look=skeleton(team.name))
    shown = Team.objects.filter(is_shown=True)
    for team in shown.iterator():
        # Out of the way of the new looks: a look has no space.
        Team.objects.filter(pk=team.pk).update(look=f"- {team.pk}")
    _give(shown.order_by("created_at", "pk"), "teams", skeleton)
    _give(Method.objects.filter(visibility="PUBLIC").order_by("shown_at", "pk"), "methods", skeleton)


def _give(rows, kind, skeleton):
    first_of = {}
    for row in list(rows):
        look = skeleton(row.name)
        first = first_of.setdefault(look, row)
        if first.pk != row.pk:
            words = {"first": first.name, "first_id": first.pk, "second": row.name, "second_id": row.pk}
            sys.stdout.write(_SAID.format(kind=kind, **words))
            look = f"{look[:280]} {row.pk}"
        type(row).objects.filter(pk=row.pk).update(look=look)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0013_faults")]
    operations = [
        migrations.AddField(
            "method", "look", models.CharField(editable=False, max_length=360, null=True, unique=True)
        ),
        migrations.RunPython(give_looks, migrations.RunPython.noop),
    ]
