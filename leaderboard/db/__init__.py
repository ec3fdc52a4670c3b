"""The database's clock, next to the ORM.

Every room may import this one; it imports none.
"""
