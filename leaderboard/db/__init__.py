"""The database beside the ORM: its clock, and statements for many rows.

Every room may import this one; it imports none.
"""
