"""An edition says which unit is taken as independent; those from before keep the recording."""

from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0043_no_cards'),
    ]

    operations = [
        migrations.RemoveConstraint(
            model_name='edition',
            name='one_edition_per_ground_truth_and_protocol',
        ),
        migrations.AddField(
            model_name='edition',
            name='n_units',
            field=models.PositiveIntegerField(blank=True, help_text='How many; null: as many as its ground truth has recordings.', null=True),
        ),
        migrations.AddField(
            model_name='edition',
            name='unit',
            field=models.CharField(choices=[('recording', 'recording'), ('day', 'day'), ('given', 'given')], default='recording', help_text='What its intervals, tests and rank ranges take as independent; set when it was opened.', max_length=12),
        ),
        migrations.AlterField(
            model_name='edition',
            name='n_effective',
            field=models.JSONField(blank=True, default=dict, help_text='Effective number of units by score name: the degrees of freedom of its interval.'),
        ),
        migrations.AddConstraint(
            model_name='edition',
            constraint=models.UniqueConstraint(condition=models.Q(('discarded_at', None)), fields=('split', 'ground_truth', 'protocol', 'decimals', 'unit'), name='one_edition_per_ground_truth_and_protocol'),
        ),
        migrations.AddConstraint(
            model_name='edition',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('n_units', None), ('unit', 'recording')), models.Q(('n_units__isnull', False), ('unit__in', ['day', 'given'])), _connector='OR'), name='edition_unit_is_known'),
        ),
    ]
