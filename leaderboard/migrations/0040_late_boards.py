"""Boards may be late for some changes, and know since when they are."""

from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0039_announcements'),
    ]

    operations = [
        migrations.AddField(
            model_name='boardversion',
            name='exact_number',
            field=models.PositiveBigIntegerField(default=0, help_text='The number of the last change that no reader may be late for.'),
        ),
        migrations.AddField(
            model_name='boardversion',
            name='behind_since',
            field=models.DateTimeField(help_text='When a change last made the board that had been drawn an old one.', null=True),
        ),
        # No answer from before is known to be one that may be late.
        migrations.RunSQL('UPDATE leaderboard_boardversion SET exact_number = number', migrations.RunSQL.noop),
    ]
