"""Remarks as data: what was noticed, of what, with which numbers; and here alone, their words.

Whoever notices something makes a `Remark`, whoever prints it asks for its `sentence`. Decisions
look at the kind, the subjects and the values, never at the words.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from aerodb.errors import AeroError

#: What flight-path reconstruction finds of a flight; subjects: channels.
RESIDUAL: Final = "residual_beyond_limit"
DEPARTURE: Final = "channel_left_estimate"
RATES_AGAINST_ATTITUDE: Final = "rates_against_attitude"
SENSOR_ERROR: Final = "sensor_error_beyond_serviceable"
KNOWN_SENSOR_ERROR: Final = "calibrated_error_beyond_serviceable"
NOT_CONVERGED: Final = "reconstruction_not_converged"
#: Limits of the verdict far beyond the product's; subjects: fields of `[accuracy]`.
WIDE_LIMITS: Final = "limits_wider_than_usual"
NOT_CHECKED: Final = "kinematics_not_checked"
NEVER_AIRBORNE: Final = "never_airborne"
POSITION_AGAINST_VELOCITY: Final = "position_against_velocity"
FLOW_AGAINST_VELOCITY: Final = "flow_against_velocity"
#: The same with words of whoever found it.
FAULT: Final = "sensor_fault"
MOVING_AIR: Final = "moving_air"
MISPLACED: Final = "vane_misplaced"
SOLUTION: Final = "navigation_solution"
#: What a flight contradicts in the released version; subjects: its label and the channel.
CONTRADICTS: Final = "contradicts_version"
#: What a flight is only suspected of beside the version; the same subjects.
SUSPECTED: Final = "suspected_beside_version"
#: For which the gate will refuse a version.
REFUSED: Final = "gate_will_refuse"
#: A flight that leaves the flown envelope, whose numbers a report has in a table.
LEAVES_ENVELOPE: Final = "leaves_flown_envelope"
#: A size that a rival would need; subjects: by what the believable range is known, or empty.
NOT_BELIEVABLE: Final = "size_not_believable"
#: An error by which a flight cannot be used; subjects: where, and what to do; either may be empty.
UNUSABLE: Final = "flight_unusable"
#: What has no words of its own here: the text is the sentence.
SAID: Final = "said"


@dataclass(frozen=True)
class Remark:
    """Something noticed.

    kind : of what; one of `WORDS`, or of the suspicions.
    subjects : names of channels, flights, versions or hypotheses, in the order of the sentence.
    values : name -> value and its unit.
    text : words that only whoever noticed it knows, such as the message of an error.
    """

    kind: str
    subjects: tuple[str, ...] = ()
    values: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    text: str = ""

    @property
    def sentence(self) -> str:
        """The remark in words, as clauses without a full stop; values with their units."""
        return ": ".join(WORDS[self.kind](self) if self.kind in WORDS else (self.text,))

    @property
    def clause(self) -> str:
        """The remark without details, as a clause of the summary of a flight's verdict."""
        if self.kind in CLAUSES:
            return CLAUSES[self.kind](self)
        return WORDS[self.kind](self)[0] if self.kind in WORDS else self.text

    def document(self) -> dict[str, Any]:
        """As a JSON document: kind, subjects, values (None where not finite) and text.

        Each value with its unit; `from_document` reads it back.
        """
        values = {
            name: [value if math.isfinite(value) else None, unit]
            for name, (value, unit) in self.values.items()
        }
        return {
            "kind": self.kind,
            "subjects": list(self.subjects),
            "values": values,
            "text": self.text,
        }


def from_document(document: Mapping[str, Any]) -> Remark:
    """Return the remark of a `Remark.document`.

    Values with their units. Raises KeyError for a document that lacks one of its parts.
    """
    values = {
        name: (math.nan if value is None else float(value), unit)
        for name, (value, unit) in document["values"].items()
    }
    return Remark(document["kind"], tuple(document["subjects"]), values, document["text"])


def sentences(remarks: Iterable[Remark]) -> list[str]:
    """Return the remarks in words."""
    return [remark.sentence for remark in remarks]


def said(text: str) -> Remark:
    """Return the remark that a text is."""
    return Remark(SAID, text=text)


def of_error(error: AeroError) -> Remark:
    """Return the remark that an error is."""
    return Remark(UNUSABLE, (error.where, error.remedy), text=error.what)


def _shown(remark: Remark, name: str) -> str:
    """A value with its unit, two digits; angles in degrees."""
    value, unit = _for_eyes(remark, name)
    return f"{value:.2g} {unit}"


def _for_eyes(remark: Remark, name: str) -> tuple[float, str]:
    """A value and its unit; angles in degrees."""
    value, unit = remark.values[name]
    return (math.degrees(value), "deg") if unit == "rad" else (value, unit)


#: Channel -> the setting in [accuracy] of the vehicle file that is its limit.
_SETTING: Final[Mapping[str, str]] = {
    **dict.fromkeys(("phi", "theta", "psi"), "attitude"),
    **dict.fromkeys(("alpha", "beta"), "flow_angle"),
    **dict.fromkeys(("velocity_north", "velocity_east"), "horizontal_velocity"),
    "velocity_down": "climb_rate",
    **dict.fromkeys(("north", "east"), "lateral_position"),
    "altitude": "altitude",
    **dict.fromkeys(("V", "qbar"), "qbar_fraction"),
}


def _residual(remark: Remark) -> tuple[str, ...]:
    (channel, *_), size, limit = remark.subjects, _shown(remark, "rms"), _shown(remark, "limit")
    setting = (
        f" ([accuracy] {_SETTING[channel]}, [sensors.{channel}] noise)"
        if channel in _SETTING
        else ""
    )
    return (f"{channel} remains {size} from the reconstructed motion; limit {limit}{setting}",)


def _departure(remark: Remark) -> tuple[str, ...]:
    size, limit = _shown(remark, "rms"), _shown(remark, "limit")
    return (
        f"{remark.subjects[0]} has left the estimate",
        f"it disagrees with the motion that the other channels show by {size} (rms; limit {limit});"
        " the rest is judged without it",
    )


def _wide(remark: Remark) -> tuple[str, ...]:
    told = [f"{name} {remark.values[name][0]:.3g} times" for name in remark.subjects]
    return (
        "this verdict has wider limits than the product's ([accuracy] of the vehicle file or of"
        " settings.toml)",
        ", ".join(told),
    )


def _rates(remark: Remark) -> tuple[str, ...]:
    return (
        "the rates do not belong to the attitude",
        f"{' and '.join(remark.subjects)} disagree with them together",
    )


def _sensor_error(remark: Remark) -> tuple[str, ...]:
    label, *bound = remark.subjects
    if "bound" in remark.values:
        value = remark.values["bound"][0]
        return (f"{label} is {value:g} or beyond: no serviceable sensor has that; not corrected",)
    value, size = (remark.values[name][0] for name in ("value", "serviceable"))
    beside = f", with {' and '.join(bound)} at a bound" if bound else ""
    beside += ", and known from its calibration" if remark.kind == KNOWN_SENSOR_ERROR else ""
    return (f"{label} of {value:.3g} is beyond any serviceable sensor ({size:g}){beside}",)


def _position(remark: Remark) -> tuple[str, ...]:
    figures = ", ".join(f"{remark.values[name][0]:.1f}" for name in remark.subjects)
    (jump, unit), (limit, _) = remark.values["jump"], remark.values["limit"]
    return (
        "position is not the integral of velocity",
        f"off by {figures} {unit} rms (north, east, down), jumps to {jump:.0f} {unit}; limit"
        f" {limit:.3g} {unit}",
    )


def _flow(remark: Remark) -> tuple[str, ...]:
    mean, deviation, limit = (_for_eyes(remark, name)[0] for name in ("mean", "deviation", "limit"))
    return (
        f"alpha of velocity less wind differs from the probe by {mean:.1f} deg mean,"
        f" {deviation:.1f} deg std; limit {limit:.1f} deg",
    )


def _moving_air(remark: Remark) -> tuple[str, ...]:
    """The strongest gusts, and by which methods the flight can be used all the same."""
    if not remark.values:
        return (remark.text,)
    size = _shown(remark, max(remark.values, key=lambda name: remark.values[name][0]))
    return (f"turbulence of {size} rms", "use regression or filter error, not output error")


def _not_believable(remark: Remark) -> tuple[str, ...]:
    (value, unit), (low, _), (high, _) = (remark.values[n] for n in ("value", "low", "high"))
    needed = f"{value:.3g}" + ("" if unit in ("", "1") else f" {unit}")
    by = f" by {remark.subjects[0]}" if remark.subjects[0] else ""
    return (f"would need {needed}, believable{by} is {low:.3g} to {high:.3g}",)


#: Kind -> its words: a clause, and after a colon the details, if any.
WORDS: Final[Mapping[str, Callable[[Remark], tuple[str, ...]]]] = {
    RESIDUAL: _residual,
    DEPARTURE: _departure,
    RATES_AGAINST_ATTITUDE: _rates,
    SENSOR_ERROR: _sensor_error,
    KNOWN_SENSOR_ERROR: _sensor_error,
    WIDE_LIMITS: _wide,
    NOT_CONVERGED: lambda _: (
        "the reconstruction did not converge",
        "the channels do not quite belong to one motion",
    ),
    NOT_CHECKED: lambda r: ("kinematics not checked", r.text),
    NEVER_AIRBORNE: lambda _: (
        "the aircraft was never airborne: nothing can be learnt of its aerodynamics",
    ),
    POSITION_AGAINST_VELOCITY: _position,
    FLOW_AGAINST_VELOCITY: _flow,
    MOVING_AIR: _moving_air,
    CONTRADICTS: lambda r: (f"beside version {r.subjects[0]}", r.text),
    NOT_BELIEVABLE: _not_believable,
    UNUSABLE: lambda r: (str(AeroError(r.text, *r.subjects)),),
    REFUSED: lambda r: ("The gate will refuse this version", f"{r.text}."),
    SUSPECTED: lambda r: (f"suspected beside version {r.subjects[0]}", r.text),
}

#: Kind -> its clause, where that is not how its words begin.
CLAUSES: Final[Mapping[str, Callable[[Remark], str]]] = {
    MISPLACED: lambda _: "the vane seems to be elsewhere than the vehicle file says",
    MOVING_AIR: lambda _: "turbulence",
    SOLUTION: lambda _: "a navigation solution is not consistent",
    CONTRADICTS: lambda r: f"it contradicts version {r.subjects[0]}",
    UNUSABLE: lambda r: str(AeroError(r.text, r.subjects[0])),
}
