"""`manage.py grant`: let the application's own role work on PostgreSQL, after each `migrate`.

It owns nothing and cannot change the audit log, so a fault in a process cannot remove the triggers.
"""

from typing import Any, Final

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError
from django.db import connection, transaction
from psycopg import sql

ONLY: Final = {
    # Without the id: one that the sequence has yet to give would keep another event from being written.
    "leaderboard_auditevent": "SELECT, INSERT (at, actor_id, verb, noun, noun_id, details, seal_number, "
    "previous_hash, hash), UPDATE (seal_number, previous_hash, hash)",
    "django_migrations": "SELECT",
}
_ROLE: Final = (
    "SELECT rolsuper, rolreplication, rolbypassrls, "
    "(SELECT rolsuper FROM pg_roles WHERE rolname = current_user) FROM pg_roles WHERE rolname = %s"
)
# What only a superuser may take from a role.
_ABOVE_THE_OWNER: Final = ("SUPERUSER", "REPLICATION", "BYPASSRLS")
_MAY: Final = "SELECT, INSERT, UPDATE, DELETE"


class Command(BaseCommand):
    help = "Grant TSTTC_APPLICATION_ROLE what the application needs; run as the owner, after migrate."

    def handle(self, *args: Any, **options: Any) -> None:
        role = settings.APPLICATION_ROLE
        if not role:
            self.stdout.write("TSTTC_APPLICATION_ROLE is not set: the application works as the owner.")
            return
        if connection.vendor != "postgresql":
            raise CommandError("The database has no roles; expected PostgreSQL.")
        with transaction.atomic():
            make_role(role, password=settings.APPLICATION_PASSWORD)
            grant_to(role)
        self.stdout.write(f"The role {role} may do what the application does.")


def make_role(role: str, *, password: str) -> None:
    """Make the role, or set its password."""
    if not password:
        raise CommandError("TSTTC_APPLICATION_PASSWORD is not set; expected the password of the role.")
    with connection.cursor() as cursor:
        cursor.execute(_ROLE, [role])
        attributes = cursor.fetchone()
        rights = [name for name, has in zip(_ABOVE_THE_OWNER, attributes or (), strict=False) if has]
        if attributes and rights and not attributes[-1]:
            raise CommandError(
                f"The role {role} has {' and '.join(rights)}; expected neither of "
                f"{', '.join(_ABOVE_THE_OWNER)}. "
                f"Only a superuser of the database can take them: ALTER ROLE {role} WITH "
                f"{' '.join(f'NO{name}' for name in rights)}."
            )
        # It is in no group, and takes no rights that somebody gave it before. An owner who is no superuser
        # may make a role without these three rights, and may not name them in a change.
        named = rights if attributes else _ABOVE_THE_OWNER
        options = " ".join(("LOGIN", *(f"NO{name}" for name in ("CREATEDB", "CREATEROLE", *named))))
        statement = sql.SQL("{} ROLE {} WITH {} PASSWORD {}").format(
            sql.SQL("ALTER" if attributes else "CREATE"),
            sql.Identifier(role),
            sql.SQL(options),
            sql.Literal(password),
        )
        cursor.execute(statement.as_string(cursor.connection))


def grant_to(role: str) -> None:
    """Grant the rights that the application needs on every table."""
    own = sql.Identifier(role)
    with connection.cursor() as cursor:
        tables = connection.introspection.table_names(cursor)
        statements = [
            sql.SQL("GRANT USAGE ON SCHEMA public TO {}").format(own),
            sql.SQL("GRANT USAGE, SELECT ON ALL SEQUENCES IN SCHEMA public TO {}").format(own),
        ]
        for table in tables:
            name = sql.Identifier(table)
            statements += [
                sql.SQL("REVOKE ALL ON {} FROM {}").format(name, own),
                sql.SQL("GRANT {} ON {} TO {}").format(sql.SQL(ONLY.get(table, _MAY)), name, own),
            ]
        for statement in statements:
            cursor.execute(statement.as_string(cursor.connection))
