"""What an orchestrator shows of runs: names, tags, one line about each result, and refused logs.

Prefect itself is not imported."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from aerodb.storage.encoding import KEY
from aerodb.tasks.workspace_access import access_workspace

#: Endings of a log that need a person.
_REFUSED: Final = ("refused", "quarantined", "failed")
_LONGEST: Final = 300
#: Flights or logs that the name and the tags of a run hold.
_SHOWN: Final = 20


@dataclass(frozen=True)
class Label:
    """Name and tags of a run or of one of its tasks."""

    name: str
    tags: tuple[str, ...]


def label_of_run(body: str, parameters: Mapping[str, Any], workspace: str) -> Label:
    """Return name and tags of a run of the flow `body`: its vehicle, and its flights or logs.

    >>> label_of_run("update_flow", {"vehicle": "my-glider", "flights": ["a.csv"]}, "").name
    'update of my-glider: a.csv'
    """
    vehicle = str(parameters.get("vehicle") or "")
    items = [parameters[key] for key in ("flight", "version") if parameters.get(key)]
    items += [*(parameters.get("logs") or ()), *(parameters.get("flights") or ())]
    labels = labels_of_items(items[:_SHOWN], {"vehicle": vehicle}, workspace)
    tags = dict.fromkeys(tag for label in labels for tag in label.tags)
    named = ", ".join(label.name for label in labels if label.name)
    more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
    flow = body.removesuffix("_flow").replace("_", "-")
    of = f" of {vehicle}" if vehicle else ""
    all_tags = (*((f"vehicle:{vehicle}",) if vehicle else ()), *tags)
    name = f"{flow}{of}{f': {named}{more}' if named else ''}"
    return Label(name[:_LONGEST], tuple(dict.fromkeys(all_tags)))


def labels_of_items(
    items: Sequence[Any], keywords: Mapping[str, Any], workspace: str
) -> list[Label]:
    """Return the label of each item of a step: a flight by the file of its log, a version by its
    label, a log by its file; and the vehicle."""
    texts = [item if isinstance(item, str) else "" for item in items]
    known = _known([text for text in texts if KEY.fullmatch(text)], workspace)
    labels = []
    for item, text in zip(items, texts, strict=True):
        vehicle = str(keywords.get("vehicle") or getattr(item, "vehicle", "") or "")
        name, owner, kind = known.get(text, ("", vehicle, ""))
        if not kind and text and ("/" in text or "." in text):
            name, kind = Path(text).name, "flight"
        tags = [f"vehicle:{owner}"] if owner else []
        tags += [f"{kind}:{name}"] if kind else []
        labels.append(Label(name or owner, tuple(tags)))
    return labels


def _known(keys: Sequence[str], workspace: str) -> dict[str, tuple[str, str, str]]:
    """Id -> name, vehicle and kind of what is stored under it."""
    if not keys:
        return {}
    access = access_workspace(workspace)
    flights = access.catalogue.flights_by_id(keys)
    logs = access.catalogue.log_names(row.log_sha256 for row in flights.values())
    found = {
        id: (row.name or logs.get(row.log_sha256) or id[:12], row.vehicle, "flight")
        for id, row in flights.items()
    }
    others = [key for key in keys if key not in found]
    versions = access.catalogue.versions_by_id(others)
    return found | {id: (row.label, row.vehicle, "version") for id, row in versions.items()}


def refused_in(result: Any) -> list[str]:
    """Return one line for each log that a run or a step refused."""
    entries = result.get("files", [result]) if isinstance(result, Mapping) else result
    if not isinstance(entries, list):
        return []
    return [
        _line(entry)
        for entry in entries
        if isinstance(entry, Mapping)
        and ("log" in entry or "file" in entry)
        and entry.get("status", entry.get("kind")) in _REFUSED
    ]


def said_of(result: Any) -> str:
    """Return one line about the result of a step; empty where there is nothing to say."""
    if not isinstance(result, Mapping):
        return ""
    if "log" in result or "file" in result:
        return _line(result)
    reasons = result.get("reasons") or ([result["reason"]] if result.get("reason") else [])
    words = [str(result[key]) for key in ("verdict", "label") if result.get(key)]
    return ": ".join(filter(None, [" ".join(words), "; ".join(map(str, reasons))]))[:_LONGEST]


def _line(entry: Mapping[str, Any]) -> str:
    file = Path(str(entry.get("log") or entry.get("file"))).name
    ending = entry.get("status", entry.get("kind", ""))
    why = entry.get("what") or entry.get("reason") or ""
    return f"{file}: {ending}{f': {why}' if why else ''}"[:_LONGEST]
