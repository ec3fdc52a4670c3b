"""The database's clock, next to the ORM."""
