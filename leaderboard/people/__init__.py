"""People: teams, invitations, API tokens, and names that look alike.

Methods, submissions and the entry points import this room.
"""
