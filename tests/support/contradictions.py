"""What no two neighbouring lines of a result may say: the five lines of a loop against each other, its
table of errors, and the meanings of its findings."""

import re
from collections.abc import Mapping
from typing import Any

from aerodb.increments import NEAR_FLOOR
from aerodb.report.decision import decision
from aerodb.report.error_table import best_and_worse, error_rows, shown_axes
from aerodb.report.findings import meaning
from aerodb.report.next_command import accepting, measurements, measuring


def contradictions(document: Mapping[str, Any], given: tuple[str, ...] = ()) -> list[str]:
    """Pairs of lines of a closed loop's document that do not agree; empty for a good document."""
    found = []
    told = decision(document, given=given)
    lines = {label: "; ".join(texts) for label, texts in told.lines}
    strongest, left, step = (lines.get(name, "") for name in ("strongest", "left", "next"))
    strongest = f"{strongest}; {lines.get('also', '')}"
    findings, added = document["findings"], document["added"]
    rows = [row for row in error_rows(document) if row["axis"] in shown_axes(document)]
    far = [row for row in rows if row["times_floor"] and row["times_floor"] > NEAR_FLOOR]

    def never(both: bool, what: str) -> None:
        if both:
            found.append(f"{what}: {told.verdict!r} and {lines}")

    never("nothing is proved" in told.verdict and "(confirmed)" in strongest, "proved or not")
    never("errors found are in the sensors" in told.verdict and len({each["verdict"] for each in findings}) > 1, "sensors or not")  # fmt: skip
    never("nothing is missing" in told.verdict and bool(far), "missing or not")
    never("every axis at its noise floor" in left and bool(far), "at the floor or not")
    never("every axis at its noise floor" in left and any(row["times_floor"] is None for row in rows), "a floor or none")  # fmt: skip
    gate = lines.get("gate", "")
    never("refuse" in told.verdict and "checks pass" in gate, "gate")
    never("gate passes" in told.verdict and "checks pass" not in gate, "gate")
    counted = sum(int(n) for n in re.findall(r"(\d+) (?:suspicion|confirmed|errors? of sensors)", told.verdict))  # fmt: skip
    never(bool(counted) and counted != len(findings), "the number of findings")
    never("unconfirmed" in told.verdict and "(confirmed)" in lines.get("found", ""), "confirmed or not")  # fmt: skip
    changes = re.search(r"has (\d+) (?:unconfirmed )?change", told.verdict)
    never(changes is not None and int(changes[1]) != len(added), "the number of changes")
    proof, gained = lines.get("proved", ""), best_and_worse(document)
    if proof and gained is not None:
        never(("no error falls" in proof) == (gained[0]["after"] < gained[0]["before"]), "proved")
    for each in findings:
        stays_out = re.search("stayed out|lowers no error|not added", meaning(each, document))
        never(bool(stays_out) and each["hypothesis"] in added, "added or not")
    barred = {*added, *document.get("without_gain", ())}
    never(any(f" {name} " in f"{step} " for name in barred), "accepted once more")
    if "measure" in lines:
        never(not all(f"{name}=SIGMA" in step for name in measurements(document)), "measurements")
    if "close-loop" in step:
        for command in (step, accepting(document, given), measuring(document, given)):
            never(bool(command) and not all(option in command for option in given), "options")
    return found
