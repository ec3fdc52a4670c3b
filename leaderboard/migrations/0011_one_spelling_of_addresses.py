"""Every address gets its one spelling; what was sent from a mailbox counts for it after the address is gone."""

from django.core.mail.message import punycode
from django.db import migrations, models
from django.db.models import F


def respell(apps, schema_editor):
    from leaderboard.models.addresses import mailbox_of, spelled

    User = apps.get_model("leaderboard", "User")
    OldAddress = apps.get_model("leaderboard", "OldAddress")
    EmailAddress = apps.get_model("account", "EmailAddress")
    # Who has proved an address comes first, then who came first: that account gets the one spelling.
    rows = EmailAddress.objects.order_by("-verified", "user", "pk").values_list("email", flat=True)
    stored = dict.fromkeys([*rows, *User.objects.order_by("pk").values_list("email", flat=True)])
    for address in list(stored):
        wanted = spelled(_as_mailed(address))
        mailbox, kept = mailbox_of(wanted), address
        if wanted not in stored:
            User.objects.filter(email=address).update(email=wanted)
            EmailAddress.objects.filter(email=address).update(email=wanted)
            stored[wanted], kept = None, wanted
        if mailbox != _by_the_database(kept):
            OldAddress.objects.create(address=kept, mailbox=mailbox)


def _as_mailed(address):
    # Until now Django wrote the domain in ASCII, by older rules: where its mails went the address was proved.
    local, at, domain = address.rpartition("@")
    try:
        return f"{local}{at}{punycode(domain)}" if at else address
    except UnicodeError:
        return address


def _by_the_database(address):
    # As the column `User.mailbox` is computed.
    plus, at = address.find("+"), address.find("@")
    return address[:plus] + address[at:] if 0 < plus < at else address


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0010_installation"), ("account", "0009_emailaddress_unique_primary_email")]
    operations = [
        migrations.CreateModel(
            name="OldAddress",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("address", models.CharField(max_length=254, unique=True)),
                ("mailbox", models.CharField(db_index=True, max_length=254)),
            ],
        ),
        migrations.AddField("spentmailbox", "sent_until", models.DateTimeField(null=True)),
        # Until now only deleted accounts had such rows, and these send nothing any more.
        migrations.RunPython(
            lambda apps, editor: apps.get_model("leaderboard", "SpentMailbox").objects.update(sent_until=F("kept_until")),
            migrations.RunPython.noop,
        ),
        migrations.AlterField(
            "spentmailbox",
            "sent_until",
            models.DateTimeField(help_text="What the account sent later does not count for the mailbox."),
        ),
        migrations.RunPython(respell, migrations.RunPython.noop),
    ]
