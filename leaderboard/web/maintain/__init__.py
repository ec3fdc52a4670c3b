"""Pages of maintainers: editions, queue, quotas, audit log."""
