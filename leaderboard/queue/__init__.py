"""Queue: workers claim, lease and decide queued evaluations. The database is the queue."""
