"""Middleware of all requests: logging, limits, sessions, uploads, headers, addresses, the page cache."""
