"""Pages of boards: tables, filters, charts, comparisons, editions, exports, badges and feeds."""
