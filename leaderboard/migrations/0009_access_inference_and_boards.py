"""Invitations, details and visibility of methods, inference, snapshots, and clients' own request names."""

import itertools

import django.core.validators
import django.db.models.deletion
import django.utils.timezone
import uuid
from django.conf import settings
from django.db import migrations, models

from leaderboard.people.names import skeleton


def fill(apps, schema_editor):
    """What is public has been shown since it was made; names that look alike are told apart by a number."""
    Method = apps.get_model("leaderboard", "Method")
    Method.objects.exclude(visibility="PRIVATE").update(shown_at=models.F("created_at"))
    Team = apps.get_model("leaderboard", "Team")
    taken = set()
    for team in Team.objects.order_by("created_at", "name"):
        wanted = skeleton(team.name)
        team.look = next(
            text for n in itertools.count(1) if (text := wanted if n == 1 else f"{wanted} {n}") not in taken
        )
        taken.add(team.look)
        team.save(update_fields=["look"])


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0008_token_limits'),
    ]

    operations = [
        migrations.CreateModel(
            name='Analysis',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('content', models.JSONField(help_text='Error by time to contact, distribution, scatter, worst recordings.')),
                ('made_at', models.DateTimeField(default=django.utils.timezone.now)),
            ],
        ),
        migrations.CreateModel(
            name='BoardVersion',
            fields=[
                ('split', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='board_version', serialize=False, to='leaderboard.split')),
                ('number', models.PositiveBigIntegerField(default=0)),
            ],
        ),
        migrations.CreateModel(
            name='Comparison',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('asked_at', models.DateTimeField(default=django.utils.timezone.now)),
                ('computed_at', models.DateTimeField(blank=True, null=True)),
                ('differences', models.JSONField(blank=True, help_text='By score name: first minus second, its 95 % interval, and p.', null=True)),
            ],
        ),
        migrations.CreateModel(
            name='IdempotencyKey',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('key', models.CharField(max_length=255)),
                ('request_digest', models.CharField(max_length=80)),
                ('created_at', models.DateTimeField(db_index=True, default=django.utils.timezone.now)),
            ],
        ),
        migrations.CreateModel(
            name='Invitation',
            fields=[
                ('id', models.UUIDField(default=uuid.uuid4, editable=False, primary_key=True, serialize=False)),
                ('secret_hash', models.CharField(max_length=64, unique=True)),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now)),
                ('expires_at', models.DateTimeField()),
                ('accepted_at', models.DateTimeField(blank=True, null=True)),
                ('revoked_at', models.DateTimeField(blank=True, null=True)),
            ],
            options={
                'ordering': ['-created_at'],
            },
        ),
        migrations.CreateModel(
            name='Snapshot',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('form', models.CharField(max_length=16)),
                ('version', models.PositiveBigIntegerField()),
                ('body', models.BinaryField()),
                ('etag', models.CharField(max_length=80)),
                ('made_at', models.DateTimeField(default=django.utils.timezone.now)),
            ],
        ),
        migrations.AddField(
            model_name='edition',
            name='inference_digest',
            field=models.CharField(blank=True, max_length=80),
        ),
        migrations.AddField(
            model_name='edition',
            name='inferred_at',
            field=models.DateTimeField(blank=True, null=True),
        ),
        migrations.AddField(
            model_name='method',
            name='box_source',
            field=models.CharField(blank=True, choices=[('GIVEN', 'given boxes'), ('DETECTED', 'own detector'), ('NONE', 'no boxes')], max_length=12),
        ),
        migrations.AddField(
            model_name='method',
            name='cameras',
            field=models.CharField(blank=True, choices=[('ONE', 'one camera'), ('SEVERAL', 'several cameras')], max_length=12),
        ),
        migrations.AddField(
            model_name='method',
            name='hardware',
            field=models.CharField(blank=True, max_length=120),
        ),
        migrations.AddField(
            model_name='method',
            name='latency_ms',
            field=models.FloatField(blank=True, null=True, verbose_name='latency in ms'),
        ),
        migrations.AddField(
            model_name='method',
            name='n_frames',
            field=models.PositiveSmallIntegerField(blank=True, null=True, validators=[django.core.validators.MinValueValidator(2), django.core.validators.MaxValueValidator(6)], verbose_name='frames used'),
        ),
        migrations.AddField(
            model_name='method',
            name='n_parameters',
            field=models.PositiveBigIntegerField(blank=True, null=True, verbose_name='parameters'),
        ),
        migrations.AddField(
            model_name='method',
            name='pretraining',
            field=models.CharField(blank=True, max_length=200),
        ),
        migrations.AddField(
            model_name='method',
            name='reveal_at',
            field=models.DateTimeField(blank=True, help_text='When an anonymous one turns public.', null=True),
        ),
        migrations.AddField(
            model_name='method',
            name='shown_at',
            field=models.DateTimeField(blank=True, help_text='When it first left private.', null=True),
        ),
        migrations.AddField(
            model_name='method',
            name='uses_extra_data',
            field=models.BooleanField(blank=True, null=True, verbose_name='extra data'),
        ),
        migrations.AddField(
            model_name='method',
            name='uses_nerf',
            field=models.BooleanField(blank=True, null=True, verbose_name='NeRF data'),
        ),
        migrations.AddField(
            model_name='score',
            name='is_with_best',
            field=models.BooleanField(blank=True, null=True),
        ),
        migrations.AddField(
            model_name='score',
            name='rank_high',
            field=models.PositiveIntegerField(blank=True, null=True),
        ),
        migrations.AddField(
            model_name='score',
            name='rank_low',
            field=models.PositiveIntegerField(blank=True, null=True),
        ),
        migrations.AddField(
            model_name='team',
            name='look',
            field=models.CharField(max_length=320, default=''),
            preserve_default=False,
        ),
        migrations.RunPython(fill, migrations.RunPython.noop),
        migrations.AlterField(
            model_name='team',
            name='look',
            field=models.CharField(max_length=320, unique=True),
        ),
        migrations.AlterField(
            model_name='method',
            name='visibility',
            field=models.CharField(choices=[('PRIVATE', 'private'), ('ANONYMOUS', 'anonymous'), ('PUBLIC', 'public')], default='PRIVATE', max_length=12),
        ),
        migrations.AddConstraint(
            model_name='method',
            constraint=models.CheckConstraint(condition=models.Q(('n_frames', None), models.Q(('n_frames__gte', 2), ('n_frames__lte', 6)), _connector='OR'), name='method_uses_2_to_6_frames'),
        ),
        migrations.AddConstraint(
            model_name='method',
            constraint=models.CheckConstraint(condition=models.Q(('latency_ms', None), models.Q(('latency_ms__gt', 0), ('latency_ms__lt', 1e+300)), _connector='OR'), name='method_latency_is_finite'),
        ),
        migrations.AddConstraint(
            model_name='method',
            constraint=models.CheckConstraint(condition=models.Q(('visibility', 'PRIVATE'), ('shown_at__isnull', False), _connector='OR'), name='what_is_shown_has_been_shown_since'),
        ),
        migrations.AddField(
            model_name='analysis',
            name='evaluation',
            field=models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, related_name='analysis', to='leaderboard.evaluation'),
        ),
        migrations.AddField(
            model_name='comparison',
            name='edition',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='comparisons', to='leaderboard.edition'),
        ),
        migrations.AddField(
            model_name='comparison',
            name='first',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to='leaderboard.evaluation'),
        ),
        migrations.AddField(
            model_name='comparison',
            name='second',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to='leaderboard.evaluation'),
        ),
        migrations.AddField(
            model_name='idempotencykey',
            name='submission',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to='leaderboard.submission'),
        ),
        migrations.AddField(
            model_name='idempotencykey',
            name='user',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to=settings.AUTH_USER_MODEL),
        ),
        migrations.AddField(
            model_name='invitation',
            name='accepted_by',
            field=models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL),
        ),
        migrations.AddField(
            model_name='invitation',
            name='created_by',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to=settings.AUTH_USER_MODEL),
        ),
        migrations.AddField(
            model_name='invitation',
            name='team',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='invitations', to='leaderboard.team'),
        ),
        migrations.AddField(
            model_name='snapshot',
            name='edition',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='snapshots', to='leaderboard.edition'),
        ),
        migrations.AddIndex(
            model_name='comparison',
            index=models.Index(condition=models.Q(('computed_at', None)), fields=['asked_at'], name='comparison_waiting'),
        ),
        migrations.AddConstraint(
            model_name='comparison',
            constraint=models.UniqueConstraint(fields=('edition', 'first', 'second'), name='one_comparison_per_pair'),
        ),
        migrations.AddConstraint(
            model_name='idempotencykey',
            constraint=models.UniqueConstraint(fields=('user', 'key'), name='idempotency_key_once_per_person'),
        ),
        migrations.AddConstraint(
            model_name='snapshot',
            constraint=models.UniqueConstraint(fields=('edition', 'form'), name='one_snapshot_per_edition_and_form'),
        ),
    ]
