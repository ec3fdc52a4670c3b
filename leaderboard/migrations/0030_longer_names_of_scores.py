"""Room for the names of metrics and TTC ranges to come."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0029_sweep_without_beat")]
    operations = [
        migrations.AlterField(model_name="score", name="metric", field=models.CharField(max_length=32)),
        migrations.AlterField(model_name="score", name="interval", field=models.CharField(max_length=32)),
    ]
