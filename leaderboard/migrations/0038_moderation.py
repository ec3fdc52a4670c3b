"""Submissions can be hidden, and names of the audit log stand in a table where they can be blanked."""

import django.db.models.deletion
import uuid
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0037_outbox'),
    ]

    operations = [
        migrations.AddField(
            model_name='submission',
            name='hidden_at',
            field=models.DateTimeField(blank=True, help_text='When a maintainer took it off the boards of all times.', null=True),
        ),
        migrations.CreateModel(
            name='AuditText',
            fields=[
                ('id', models.UUIDField(default=uuid.uuid4, editable=False, primary_key=True, serialize=False)),
                ('text', models.CharField(blank=True, help_text='Empty: blanked.', max_length=300)),
                ('noun', models.CharField(max_length=40)),
                ('noun_id', models.CharField(max_length=80)),
                ('actor', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL)),
            ],
            options={
                'indexes': [models.Index(fields=['noun', 'noun_id'], name='audit_text_by_noun')],
            },
        ),
    ]
