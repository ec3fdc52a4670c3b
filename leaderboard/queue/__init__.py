"""Queue: an evaluation from queued to scored; workers claim, lease and decide it.

The database is the queue.
"""
