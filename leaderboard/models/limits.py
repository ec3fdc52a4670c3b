"""What all web processes share so that limits hold for them together: no broker, no other server."""

from django.db import models


class Allowance(models.Model):
    """How far somebody has drawn on a rate: a time that one statement moves on; see `ops.rate_limits`.

    Worth nothing once its time is over, and lost in a crash of the server without harm.
    """

    # A hash: addresses and accounts are nobody's business here.
    key = models.CharField(max_length=64, primary_key=True)
    free_at_s = models.FloatField(help_text="Seconds since 1970 at which it is as if nothing had been asked.")

    def __str__(self) -> str:
        return self.key


class CachedValue(models.Model):
    """The table of Django's database cache, which the limits of signing in are counted in."""

    cache_key = models.CharField(max_length=255, primary_key=True)
    value = models.TextField()
    expires = models.DateTimeField(db_index=True)

    class Meta:
        db_table = "leaderboard_cache"

    def __str__(self) -> str:
        return self.cache_key
