"""Middleware of all requests: logging, limits, sessions, uploads, headers, the page cache."""
