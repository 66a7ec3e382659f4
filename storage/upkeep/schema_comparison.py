"""Comparison of a catalogue's tables, indices, triggers, views, rules and functions with those that
the migrations make.

Nothing is listed here: the migrations run once more, in a database in memory or in a schema of the
server that is rolled back, and what they make is what is expected.
"""

import secrets
from collections.abc import Iterator
from typing import Final

import sqlalchemy as sa

from aerodb.storage.catalogue import FORMER, upgrade

#: What kind of object, its table, its name.
Thing = tuple[str, str, str]
#: What a table that a migration has kept consists of: a trigger or a rule on it is not aerodb's.
_KEPT: Final = frozenset({"table", "column", "constraint"})


def differences(connection: sa.Connection) -> Iterator[tuple[str, str]]:
    """Yield what differs (``is missing``, ``is not aerodb's``, ``is changed``) and the object.

    connection : of an up-to-date catalogue, in a transaction. Errors of SQLAlchemy as they are: a
    user of a server who may not make schemas is one.
    """
    found = _definitions(connection)
    expected = _expected(connection)
    for thing in sorted(found.keys() | expected.keys()):
        kind, table, name = thing
        where = f"{kind} {name}" + (f" of {table}" if table not in ("", name) else "")
        if thing not in found:
            yield "it is missing", where
        elif thing not in expected:
            if table.startswith(FORMER) and kind in _KEPT:
                continue
            yield "it is none of those that aerodb makes", where
        elif found[thing] != expected[thing]:
            yield "its text is not the one that aerodb writes", where


def _expected(connection: sa.Connection) -> dict[Thing, str]:
    if connection.dialect.name == "sqlite":
        engine = sa.create_engine("sqlite://")
        try:
            with engine.begin() as made:
                upgrade(made)
                return _definitions(made)
        finally:
            engine.dispose()
    own = connection.exec_driver_sql("SHOW search_path").scalar_one()
    name = f"aerodb_{secrets.token_hex(8)}"
    trial = connection.begin_nested()
    try:
        connection.exec_driver_sql(f"CREATE SCHEMA {name}")
        connection.exec_driver_sql(f"SET LOCAL search_path TO {name}")
        upgrade(connection)
        return _definitions(connection)
    finally:
        trial.rollback()
        connection.execute(sa.select(sa.func.set_config("search_path", own, True)))


def _definitions(connection: sa.Connection) -> dict[Thing, str]:
    query = _DEFINITIONS[connection.dialect.name]
    rows = connection.exec_driver_sql(query).all()
    schema = (
        ""
        if connection.dialect.name == "sqlite"
        else f"{connection.exec_driver_sql('SELECT current_schema()').scalar_one()}."
    )
    things: dict[Thing, str] = {}
    for kind, table, name, text in rows:
        text = " ".join((text or "").split())
        things[kind, table, name] = text.replace(schema, "") if schema else text
    return things


#: Queries: kind, table, name and text of each object. Left out are the statistics of ANALYZE, and
#: what belongs to an extension of the server.
_DEFINITIONS: Final = {
    "sqlite": (
        "SELECT type, tbl_name, name, sql FROM sqlite_master WHERE NOT (type = 'table' AND name IN"
        " ('sqlite_sequence', 'sqlite_stat1', 'sqlite_stat4'))"
    ),
    "postgresql": """
WITH here AS (SELECT oid FROM pg_namespace WHERE nspname = current_schema()),
own AS (
    SELECT c.* FROM pg_class c WHERE relnamespace IN (SELECT oid FROM here) AND NOT EXISTS (
        SELECT 1 FROM pg_depend d WHERE d.objid = c.oid AND d.deptype = 'e'))
SELECT CASE WHEN c.relkind IN ('v', 'm') THEN 'view' ELSE 'table' END, c.relname::text,
    c.relname::text,
    concat_ws(' ', c.relkind, pg_get_viewdef(c.oid), c.relrowsecurity)
    FROM own c WHERE c.relkind IN ('r', 'p', 'v', 'm', 'f')
UNION ALL
SELECT 'column', c.relname, a.attname, concat_ws(' ', format_type(a.atttypid, a.atttypmod),
    a.attnotnull, o.collname, pg_get_expr(e.adbin, e.adrelid))
    FROM own c JOIN pg_attribute a ON a.attrelid = c.oid
    LEFT JOIN pg_collation o ON o.oid = a.attcollation
    LEFT JOIN pg_attrdef e ON e.adrelid = c.oid AND e.adnum = a.attnum
    WHERE a.attnum > 0 AND NOT a.attisdropped AND c.relkind IN ('r', 'p')
UNION ALL
SELECT 'index', t.relname, c.relname, concat_ws(' ', pg_get_indexdef(c.oid), i.indisvalid)
    FROM own c JOIN pg_index i ON i.indexrelid = c.oid JOIN pg_class t ON t.oid = i.indrelid
UNION ALL
SELECT 'constraint', c.relname, k.conname,
    concat_ws(' ', pg_get_constraintdef(k.oid), k.convalidated)
    FROM own c JOIN pg_constraint k ON k.conrelid = c.oid
UNION ALL
SELECT 'trigger', c.relname, g.tgname, concat_ws(' ', g.tgenabled, pg_get_triggerdef(g.oid))
    FROM own c JOIN pg_trigger g ON g.tgrelid = c.oid WHERE NOT g.tgisinternal
UNION ALL
SELECT 'check of', c.relname, k.conname,
    string_agg(concat_ws(' ', g.tgtype, g.tgenabled), ' ' ORDER BY g.tgtype)
    FROM own c JOIN pg_trigger g ON g.tgrelid = c.oid
    JOIN pg_constraint k ON k.oid = g.tgconstraint WHERE g.tgisinternal GROUP BY 1, 2, 3
UNION ALL
SELECT 'rule', c.relname, r.rulename, pg_get_ruledef(r.oid) FROM own c
    JOIN pg_rewrite r ON r.ev_class = c.oid WHERE r.rulename <> '_RETURN'
UNION ALL
SELECT 'function', '', concat(p.proname, '(', pg_get_function_identity_arguments(p.oid), ')'),
    concat_ws(' ', l.lanname, p.prosrc, p.prosecdef) FROM pg_proc p JOIN pg_language l
    ON l.oid = p.prolang WHERE p.pronamespace IN (SELECT oid FROM here) AND NOT EXISTS (
        SELECT 1 FROM pg_depend d WHERE d.objid = p.oid AND d.deptype = 'e')
""",
}
