"""Pages: each view translates a request, calls one domain function, and renders a template."""
