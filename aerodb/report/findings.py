"""Findings and remarks of an update or a closed loop as a page tells them: in words, with names for
ids, in display units."""

import re
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from aerodb.report.glossary import (
    capital,
    effect_words,
    in_words,
    parameter_name,
    rejected,
    with_true_signs,
)
from aerodb.report.numbers import for_people
from aerodb.report.style import Picture
from aerodb.report.update_figures import forest_figure, voter

#: Verdict -> its meaning, for a reader.
MEANS: Final[Mapping[str, str]] = {
    "confirmed": "no other hypothesis explains it as well, and no single sensor error removes it",
    "suspected": "the best explanation, but too few independent flights for the stated error rate",
    "alias_group": "several explanations fit these flights equally well",
    "ambiguous_sensor": "a sensor error cannot be excluded",
    "sensor": "a sensor error; to be corrected in flight-path reconstruction",
    "unnamed": "reproducible, but no effect that is known fits",
    "not_detected": "not found; sizes above the bound are excluded",
    "not_excited": "the flights do not excite it",
    "not_separable": "it cannot be separated from other effects in these flights",
    "not_testable": "too few flights show it",
}
#: A flight or a part of one in a sentence: the first digits of its id, and from and to [s].
_FLIGHT: Final = re.compile(r"\b([0-9a-f]{12}(?:@[\d.]+-[\d.]*\d)?)(?: s\b)?")
#: Fewest votes of which a forest plot is drawn.
_WITH_VOTES: Final = 2
#: An estimate this share of its interval away from the mean of the flights is not that mean.
_SAME: Final = 0.05


def meaning(finding: Mapping[str, Any], document: Mapping[str, Any]) -> str:
    """Return what the verdict of a finding of a closed loop means (docs/reference/contract.md,
    section Verdict names), and why it was added although it is not confirmed."""
    verdict, added = finding["verdict"], document.get("added", ())
    means = MEANS.get(verdict, "")
    if verdict == "confirmed" and finding["hypothesis"] not in added:
        idle = finding["hypothesis"] in document.get("without_gain", ())
        return f"{means}; {'it lowers no error of other flights' if idle else 'it stayed out'}"
    if finding["hypothesis"] not in added or verdict == "confirmed":
        return f"{means}, so it is not added" if verdict == "ambiguous_sensor" else means
    asked = finding["hypothesis"] in document.get("asked_for", added)  # not in older documents
    why = (
        "because you asked for it"
        if asked
        else "with others of its axis, whose sum is known better"
    )
    return f"{means}; it was added {why}"


def told(finding: Mapping[str, Any], labels: Mapping[str, str]) -> dict[str, Any]:
    """Return a finding in words with its figure, in display units (`for_people`: degrees for
    radians).

    labels : flight (id) -> its name.
    """
    factor, unit = for_people(finding["unit"])
    shown = None
    if len(finding["votes"]) >= _WITH_VOTES:
        shown = Picture(
            partial(forest_figure, finding, labels),
            f"Estimates of {parameter_name(finding['parameter'])} from {len(finding['votes'])}"
            " flights with 95 % intervals, and the combined estimate.",
            "Dots: the estimate of each flight with its 95 % interval. Diamond and band:"
            " combined estimate with its 95 % interval, random and systematic errors included.",
        )
    ci95 = finding["ci95"]
    return {
        **finding,
        "shown_value": None if finding["value"] is None else factor * finding["value"],
        "shown_ci95": None if ci95 is None else [factor * end for end in ci95],
        "shown_unit": unit,
        "effect_words": effect_words(finding),
        "says": finding_sentence(finding, labels),
        "shown_error": None if ci95 is None else factor * (ci95[1] - ci95[0]) / 2.0,
        "mean": _mean_test(finding, factor),
        "rivals": list(finding["explanation_set"][1:]),
        "fallen": rejected(finding),
        "refound": finding.get("refound", (0, 0)),
        "held_out_share": finding.get("held_out_share"),
        "picture": shown,
    }


def finding_sentence(finding: Mapping[str, Any], labels: Mapping[str, str]) -> str:
    """Return what a finding says, without its numbers: it is estimated once more after it was said.

    labels : names of flights. Documents of earlier releases hold the whole sentence alone.
    """
    without = (finding["what"], *finding["reasons"]) if "what" in finding else [finding["because"]]
    return sentence_of("; ".join(without), labels)


def sentence_of(text: str, labels: Mapping[str, str]) -> str:
    """Return a sentence of a document as people read it: names of effects and flights for their
    ids. See `in_words`, `with_true_signs` and `named_flights`."""
    return capital(named_flights(with_true_signs(in_words(text)), labels))


def named_flights(text: str, labels: Mapping[str, str]) -> str:
    """Return a sentence with the names of flights for their ids, and for parts of flights with
    their window [s] (`voter`)."""
    return _FLIGHT.sub(lambda found: voter(found[1], labels), text)


def _mean_test(finding: Mapping[str, Any], factor: float) -> dict[str, Any] | None:
    """The test of the mean over the flights, in display units, and why the interval of the estimate
    contains zero although that of the mean does not; None for older documents."""
    test = finding.get("test")
    if test is None:
        return None
    low, high = test["ci95"]
    first, last = finding["ci95"]
    wider = not low <= 0.0 <= high and first <= 0.0 <= last
    why = "its shape misses" if finding.get("shape") else "sensors and noise may add"
    return {
        "value": factor * test["mean"],
        "ci95": [factor * low, factor * high],
        "p": test["p"],
        "joint": abs(finding["value"] - test["mean"]) > _SAME * (last - first),
        "wider": f"what {why} anywhere in the flown range" if wider else "",
    }
