"""Reasons of verdicts as data, beside their sentences; those that are there are read once more."""

import json
import re
from typing import Any, Final

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers, link_stored_rows

revision = "r0011"
down_revision = "r0010"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_AT_ONCE: Final = 1000
#: The two reasons of which something depended on how they begin.
_BESIDE: Final = re.compile(
    r"(?P<suspected>suspected )?beside version (?P<label>[^:]*): (?P<text>.*)", re.DOTALL
)


def _remark(sentence: str) -> dict[str, Any]:
    """The remark that a stored sentence was, as of this migration."""
    kind, subjects, text = "said", list[str](), sentence
    if found := _BESIDE.fullmatch(sentence):
        kind = "suspected_beside_version" if found["suspected"] else "contradicts_version"
        subjects, text = [found["label"]], found["text"]
    return {"kind": kind, "subjects": subjects, "values": {}, "text": text}


def upgrade() -> None:
    """Add the table, fill and link it, and make it append-only."""
    table = op.create_table(
        "verdict_remarks",
        sa.Column("event", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("remarks", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["event"], ["flight_events.sequence"], name=op.f("fk_verdict_remarks_event")
        ),
        sa.PrimaryKeyConstraint("event", name=op.f("pk_verdict_remarks")),
        sqlite_strict=True,
    )
    connection = op.get_bind()
    read = sa.text(
        "SELECT sequence, reasons FROM flight_events WHERE kind = 'verdict' AND reasons <> '[]'"
        " AND sequence > :after ORDER BY sequence LIMIT :most"
    )
    after = 0
    while rows := connection.execute(read, {"after": after, "most": _AT_ONCE}).all():
        after = rows[-1].sequence
        connection.execute(
            sa.insert(table),
            [
                {
                    "event": row.sequence,
                    "remarks": json.dumps(
                        [_remark(each) for each in json.loads(row.reasons)],
                        ensure_ascii=False,
                        sort_keys=True,
                        separators=(",", ":"),
                    ),
                }
                for row in rows
            ],
        )
    link_stored_rows(connection, table)
    for statement in append_only_triggers(connection.dialect.name, "verdict_remarks", [("event",)]):
        op.execute(statement)
