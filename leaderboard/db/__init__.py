"""The database beside the ORM: its clock.

Every room may import this one; it imports none.
"""
