"""Pages of maintainers: editions, queue, quotas, audit trail."""
