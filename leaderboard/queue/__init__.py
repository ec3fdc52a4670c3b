"""Workers: the work that worker processes find by themselves: sweep, low-priority jobs, cleaning.

Only Celery's entry points and commands import this room.
"""
