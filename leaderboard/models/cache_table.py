"""The table of Django's database cache, in which all web processes count sign-ins."""

from django.db import models


class CachedValue(models.Model):
    cache_key = models.CharField(max_length=255, primary_key=True)
    value = models.TextField()
    expires = models.DateTimeField(db_index=True)

    class Meta:
        db_table = "leaderboard_cache"

    def __str__(self) -> str:
        return self.cache_key
