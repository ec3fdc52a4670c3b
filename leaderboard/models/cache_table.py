"""What all web processes share so that limits hold for them together: no broker, no other server."""

from django.db import models


class CachedValue(models.Model):
    """The table of Django's database cache, which the limits of signing in are counted in."""

    cache_key = models.CharField(max_length=255, primary_key=True)
    value = models.TextField()
    expires = models.DateTimeField(db_index=True)

    class Meta:
        db_table = "leaderboard_cache"

    def __str__(self) -> str:
        return self.cache_key
