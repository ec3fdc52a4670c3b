"""Pages: each view translates a request, calls one domain function, and renders a template.

Only the addresses import this room; the settings take the frame of `middleware/`.
"""
