"""Lineage of a version as W3C PROV-JSON: its sources, its runs, and who moved its names.

Entities are versions, flights and logs; activities are runs and moves of names; agents are this
software and people. The ids are ours: ``version:``, ``flight:``, ``log:`` and ``run:`` before the
id of the catalogue.
"""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from prov.constants import PROV
from prov.identifier import Namespace, QualifiedName
from prov.model import ProvDocument

from aerodb.errors import InputError
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import Lineage, NameEvent, RunRow, VersionRow

_KINDS = ("version", "flight", "log", "run", "move", "agent")
_OWN = Namespace("aerodb", "urn:aerodb:")


def prov_json(
    lineage: Lineage, settings: Mapping[str, Mapping[str, object]], moves: Sequence[NameEvent]
) -> bytes:
    """Return `lineage` as PROV-JSON (W3C Member Submission 2013), UTF-8, read back and found equal
    before it is returned.

    settings : version -> what made it. moves : those of names to versions of the line; others are
    left out. Raises InputError where it reads back differently.
    """
    document = ProvDocument()
    for kind in _KINDS:
        document.add_namespace(kind, f"urn:aerodb:{kind}:")
    document.add_namespace(_OWN)
    software = document.agent(
        "aerodb:aerodb", {"prov:type": PROV["SoftwareAgent"], "prov:label": "aerodb"}
    )
    for run in lineage.runs:
        document.wasAssociatedWith(_run(document, run), software)
    noted = {run.id for run in lineage.runs}
    for flight, role in sorted(lineage.roles.items()):
        log = document.entity(
            f"log:{lineage.logs[flight]}",
            {"prov:type": _own("log"), "aerodb:sha256": lineage.logs[flight]},
        )
        document.entity(f"flight:{flight}", {"prov:type": _own("flight"), "aerodb:role": role})
        document.wasDerivedFrom(f"flight:{flight}", log)
    for row in lineage.line:
        _version(document, row, settings.get(row.id, {}), lineage.inputs.get(row.id, ()))
        if row.run in noted:
            document.wasGeneratedBy(f"version:{row.id}", f"run:{row.run}")
        if row.parent is not None:
            document.wasDerivedFrom(f"version:{row.id}", f"version:{row.parent}")
    for flight, role in sorted(lineage.roles.items()):
        if role != "excluded":
            document.wasDerivedFrom(
                f"version:{lineage.version.id}",
                f"flight:{flight}",
                other_attributes={"aerodb:role": role},
            )
    line = {row.id for row in lineage.line}
    for move in moves:
        if move.version in line:
            _move(document, move)
    return _checked(document)


def _version(
    document: ProvDocument, row: VersionRow, settings: Mapping[str, object], inputs: Sequence[str]
) -> None:
    attributes = {
        "prov:type": _own("version"),
        "prov:label": f"{row.vehicle} {row.label}",
        "aerodb:content_sha256": row.content_sha256,
        "aerodb:settings": enc.to_json(dict(settings)),
    }
    document.entity(
        f"version:{row.id}", [*attributes.items(), *(("aerodb:input", key) for key in inputs)]
    )


def _run(document: ProvDocument, run: RunRow) -> QualifiedName:
    attributes = [
        ("prov:type", _own(run.flow)),
        ("aerodb:how", run.how),
        ("aerodb:state", run.state),
    ]
    code = ("aerodb:code_version", run.code_version)
    activity = document.activity(
        f"run:{run.id}", run.started_utc, run.ended_utc, [*attributes, code]
    )
    return _name(activity.identifier)


def _move(document: ProvDocument, move: NameEvent) -> None:
    # What a user is called is text from outside: it becomes a label, never part of an id.
    person = document.agent(
        f"agent:{hashlib.sha256(move.user.encode()).hexdigest()[:16]}",
        {"prov:type": PROV["Person"], "prov:label": move.user},
    )
    attributes: dict[str, Any] = {
        "prov:type": _own("name_moved"),
        "aerodb:name": move.name,
        "aerodb:reason": move.reason,
    }
    activity = document.activity(f"move:{move.sequence}", move.at_utc, move.at_utc, attributes)
    document.used(activity, f"version:{move.version}", move.at_utc)
    document.wasAssociatedWith(activity, person)


def _own(name: str) -> QualifiedName:
    return QualifiedName(_OWN, name)


def _name(identifier: object) -> QualifiedName:
    assert isinstance(identifier, QualifiedName)
    return identifier


def _checked(document: ProvDocument) -> bytes:
    document = document.unified()  # who moved names twice is one agent
    text = document.serialize(format="json", indent=1)
    assert text is not None  # it is, where no destination is given
    if ProvDocument.deserialize(content=text, format="json") != document:
        raise InputError(
            "the lineage cannot be represented in PROV-JSON",
            "export",
            "report this as a bug of aerodb",
        )
    return text.encode("utf-8")
