"""Statements that are made for every submission: PostgreSQL parses and plans each once for a connection.

Half of its work for a submission was to parse and to plan the same nine statements again.
"""

from typing import Any

import psycopg
from django.db import connection


def cursor() -> Any:
    """A cursor whose statements are kept by the connection. Give it few different ones, with parameters.

    On SQLite, which plans in no time, any cursor.
    """
    if connection.vendor != "postgresql":
        return connection.cursor()
    # As `connection.cursor` does, whose own cursors have no parameters by the time PostgreSQL sees them.
    connection.close_if_health_check_failed()
    connection.ensure_connection()
    made: Any = connection.make_debug_cursor if connection.queries_logged else connection.make_cursor
    return made(psycopg.Cursor(connection.connection))
