"""Documents of a workspace or a console that print as a few lines, and are dicts otherwise."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from aerodb.flows.library.views import Summary, html_of

#: Channels of a flight -> columns of its table.
_HEADER: Final = ("channel", "before", "after", "limit", "unit", "verdict")


class Document(dict[str, Any]):
    """A document as JSON has it; ``print`` and a notebook show what decides."""

    def __init__(
        self, document: Mapping[str, Any], told: Callable[[Mapping[str, Any]], Summary]
    ) -> None:
        super().__init__(document)
        self._told = told

    def __str__(self) -> str:
        said = self._told(self)
        width = max((len(name) for name, _ in said.facts), default=0)
        lines = [f"  {name:<{width}}  {text}" for name, text in said.facts]
        return "\n".join([said.title, *lines, "  all of it: it is a dict"])

    def _repr_html_(self) -> str:
        """Return what decides as a notebook shows it, with its table."""
        return html_of(self._told(self))


def of_flight(document: Mapping[str, Any]) -> Document:
    """Return the document of a flight; printed: its verdict, why, and the versions based on it."""
    return Document(document, _flight)


def of_finding(document: Mapping[str, Any]) -> Document:
    """Return the document of an update or a closed loop; printed: what to decide on."""
    return Document(document, _finding)


def _flight(document: Mapping[str, Any]) -> Summary:
    from aerodb.report import for_people, reasons_in_units, sensor_error_unit  # slow to import

    log, consistency = document["log"], document["consistency"]
    name = document["name"] or (log or {}).get("name") or document["flight"][:12]
    reasons = reasons_in_units(document)
    reasons += [entry["sentence"] for entry in document["suspicions"]]
    used = [f"{each['label']} ({each['role'].replace('_', ' ')})" for each in document["versions"]]
    start = (document["start_utc"] or "at an unknown time")[:16].replace("T", " ")
    facts = [
        ("flown", f"{start}, {document['duration']:.1f} s, {document['samples']} samples"),
        ("because", "; ".join(reasons)),
        ("used by", ", ".join(used) or "no version"),
    ]
    rows = []
    for each in (consistency or {}).get("channels", ()):
        factor, unit = for_people(sensor_error_unit(each["channel"]))
        sizes = [each[key] for key in ("before", "after", "limit")]
        shown = ["-" if size is None else f"{factor * size:.3g}" for size in sizes]
        rows.append((each["channel"], *shown, unit, each["verdict"]))
    verdict = "retracted" if document["retracted"] else document["verdict"]
    title = f"flight {name} of {document['vehicle']}: {verdict}"
    return Summary(title, [fact for fact in facts if fact[1]], _HEADER, rows)


def _finding(document: Mapping[str, Any]) -> Summary:
    from aerodb.report import decision  # slow to import

    label = document.get("label") or (document["candidate"] or "")[:12]
    told = decision({**document, "label": label}, rest='["findings"]')
    facts = [(name, "; ".join(texts).replace("\u2212", "-")) for name, texts in told.lines]
    return Summary(told.verdict, facts)
