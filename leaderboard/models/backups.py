"""What became of each backup, and the files that will never be in one."""

from django.db import models


class BackupRun(models.Model):
    """One run of `manage.py backup`. Without `finished_at` it still runs, or was killed."""

    started_at = models.DateTimeField(db_index=True)
    finished_at = models.DateTimeField(null=True, blank=True)
    is_ok = models.BooleanField(
        default=False, help_text="Everything that the site has is in the backup, undamaged."
    )
    n_files = models.PositiveIntegerField(default=0)
    n_damaged = models.PositiveIntegerField(
        default=0, help_text="Files that are lost, damaged or unreadable."
    )
    n_lost = models.PositiveIntegerField(
        default=0,
        help_text="Files that are lost for good, as a maintainer has said; a good run may have them.",
    )
    fault = models.TextField(blank=True, help_text="Why the run is not good; empty for a good one.")

    def __str__(self) -> str:
        return f"backup of {self.started_at:%Y-%m-%d %H:%M}, {'good' if self.is_ok else 'not good'}"


class LostFile(models.Model):
    """A file that the site has lost for good, so that backups without it are good ones."""

    name = models.CharField(max_length=200, unique=True, help_text="As the list of a backup names it.")
    reason = models.CharField(max_length=500)
    noted_at = models.DateTimeField()

    def __str__(self) -> str:
        return self.name
