"""Middleware of all requests: logging, limits, sessions, uploads, response headers, the page cache."""
