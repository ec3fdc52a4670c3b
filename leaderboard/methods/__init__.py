"""Methods: the details that a team states about a method, and who may see it.

Submissions and the entry points import this room; it reads boards and people.
"""
