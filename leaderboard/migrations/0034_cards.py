from django.db import migrations, models
import django.utils.timezone


class Migration(migrations.Migration):

    dependencies = [
        ('leaderboard', '0033_versions_of_pages'),
    ]

    operations = [
        migrations.CreateModel(
            name='CardPicture',
            fields=[
                ('digest', models.CharField(max_length=64, primary_key=True, serialize=False)),
                ('png', models.BinaryField(help_text='Empty where the card cannot be drawn.')),
                ('made_at', models.DateTimeField(default=django.utils.timezone.now)),
            ],
        ),
        migrations.AddField(
            model_name='sweepbeat',
            name='cards_begun_at',
            field=models.DateTimeField(blank=True, null=True),
        ),
    ]
