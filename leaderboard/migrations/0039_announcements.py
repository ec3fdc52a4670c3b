"""Splits have a line of text with an end."""

from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0038_moderation'),
    ]

    operations = [
        migrations.AddField(
            model_name='split',
            name='announcement',
            field=models.CharField(blank=True, help_text='One line of plain text on its pages, until it ends.', max_length=300),
        ),
        migrations.AddField(
            model_name='split',
            name='announcement_ends_at',
            field=models.DateTimeField(blank=True, null=True),
        ),
        migrations.AddConstraint(
            model_name='split',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('announcement', ''), ('announcement_ends_at', None)), models.Q(models.Q(('announcement', ''), _negated=True), ('announcement_ends_at__isnull', False)), _connector='OR'), name='split_announcement_has_an_end'),
        ),
    ]
