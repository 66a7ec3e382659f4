"""The words for effects, channels and parameters: every page, the console and printed text use
these.

Documents keep identifiers (docs/reference/conventions.md, "Names and identities"); people read
``slope of CZ with alpha`` where a document says ``alpha_slope@CZ``.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from aerodb.remarks import Remark, from_document
from aerodb.report.numbers import for_people, power_of_ten
from aerodb.units import UnitSystem

#: Effect -> its name; {axis} and {subject} are those of the hypothesis.
EFFECTS: Final[Mapping[str, str]] = {
    "zero_offset": "constant part of {axis}",
    "alpha_slope": "slope of {axis} with alpha",
    "alpha_slope_break": "change of the slope of {axis} with angle of attack above {subject}",
    "lift_scale": "size of the whole {axis} curve over angle of attack",
    "beta_slope": "slope of {axis} with sideslip",
    "beta_even": "part of {axis} that is alike for left and right sideslip",
    "table_sign": "sign or symmetry of table {subject} of {axis}",
    "sideslip_coupling": "sideslip coupling of {axis}",
    "pitch_rate_force": "slope of {axis} with pitch rate",
    "pitch_damping": "pitch damping of {axis}",
    "alpha_dot": "slope of {axis} with rate of angle of attack",
    "lift_lag": "lag of {axis} behind angle of attack by {subject}",
    "roll_damping": "roll damping of {axis}",
    "yaw_damping": "yaw damping of {axis}",
    "cross_rate": "slope of {axis} with {subject}",
    "control_effectiveness": "effectiveness of the {subject} on {axis}",
    "control_nonlinearity": "cubic part of the effectiveness of the {subject} on {axis}",
    "control_one_sided": "effectiveness of {subject} deflections on {axis}",
    "control_alpha_coupling": (
        "change of the effectiveness of the {subject} on {axis} with angle of attack"
    ),
    "surface_asymmetry": "unequal left and right {subject}, effect on {axis}",
    "speed_brake": "effectiveness of the speed brake on {axis}",
    "body_flap": "effectiveness of the body flap on {axis}",
    "flap": "effectiveness of the flap on {axis}",
    "landing_gear": "effect of the landing gear on {axis}",
    "landing_gear_beta": "effect of the landing gear on {axis} in sideslip",
    "ground_effect": "ground effect on {axis}",
    "thrust_effect": "effect of thrust on {axis}",
    "mach_effect": "change of the slope of {axis} with Mach number",
    "dynamic_pressure_effect": "change of the slope of {axis} with dynamic pressure",
    "parameter": "parameter {subject} of the database",
    "stall_hysteresis": "hysteresis of {axis} in the stall",
    "lift_hysteresis": "closed loop of {axis} in the stall",
    "unnamed": "error of {axis} that no known effect fits",
    "qbar_scale": "scale of dynamic pressure",
    "qbar_offset": "constant error of dynamic pressure",
    "alpha_bias": "constant error of angle of attack",
    "alpha_scale": "scale of angle of attack",
    "alpha_delay": "delay of angle of attack",
    "beta_bias": "constant error of sideslip",
    "beta_scale": "scale of sideslip",
    "beta_delay": "delay of sideslip",
    "reconstructed_alpha": "error of the reconstructed angle of attack ({subject})",
    "reconstructed_beta": "error of the reconstructed sideslip ({subject})",
    "air_data_position": "position of the air-data probe along body {subject}",
    "accelerometer_bias": "constant error of the accelerometer along body {subject}",
    "gyro_bias": "constant error of the gyro, {subject}",
    "gyro_scale": "scale of the gyro, {subject}",
    "mass_error": "mass",
    "cg_offset": "position of the centre of gravity along body {subject}",
    "inertia_error": "moment of inertia {subject}",
    "thrust_scale": "scale of thrust",
    "thrust_line_offset": "position of the thrust line along body {subject}",
    "surface_scale": "scale of the deflection of the {subject}",
    "surface_bias": "zero of the deflection of the {subject}",
    "surface_delay": "delay of the {subject}",
    "surface_backlash": "backlash of the {subject}",
    "surface_wide_backlash": "wide backlash of the {subject}",
    "surface_dead_zone": "dead zone of the {subject}",
    "surface_lost": "{subject} that moves less than logged, or is stuck",
}
#: Subject or channel -> its words, where underscores for spaces are not enough.
_WORDS: Final[Mapping[str, str]] = {
    "alpha": "angle of attack",
    "beta": "sideslip",
    "p": "roll rate",
    "q": "pitch rate",
    "r": "yaw rate",
    "p_hat": "roll rate",
    "q_hat": "pitch rate",
    "r_hat": "yaw rate",
    "alphadot_hat": "rate of angle of attack",
    "alphadot": "rate of angle of attack",
    "qbar": "dynamic pressure",
    "mach": "Mach number",
    "V": "airspeed",
    "phi": "bank angle",
    "theta": "pitch angle",
    "height_above_ground": "height above ground",
}
#: ``effect@axis``, ``effect@axis+axis:subject``.
_HYPOTHESIS: Final = re.compile(
    r"(?<![\w@])(?<!--accept )(?P<effect>[a-z][a-z0-9_]*)"
    r"@(?P<axes>all|C[A-Za-z_]+(?:\+C[A-Za-z_]+)*)"
    r"(?::(?P<subject>shape \d+|-?[A-Za-z0-9_]+(?:[.-][A-Za-z0-9_]+)*))?"
)
#: A channel in a sentence; not the key of a setting, nor a part of a parameter's name.
_CHANNEL: Final = re.compile(
    r"(?<![\w.])(?:delta_\w+|(?:p|q|r|alphadot)_hat|alpha|beta|qbar|mach|height_above_ground|flow_attachment)"
    r"(?![\w=.])"
)
#: A parameter of what changes from an angle of attack [rad] on.
_BREAK: Final = re.compile(r"(?P<name>C\w+_alpha) > (?P<value>\d+(?:\.\d+)?)")
_MINUS: Final = re.compile(r"(?<![\w.)\]-])-(?=[\d.])")
_LONG: Final = re.compile(r"(?<![\w.])\d+\.\d{7,}(?![\w.])")
_POWER: Final = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]?\d{1,3})\b")
#: Effects whose subject is an angle [rad].
_ANGLES: Final = frozenset({"alpha_slope_break"})


def hypothesis_words(identifier: str) -> str:
    """The name of a hypothesis (its id) in words; what is no id is returned as it is.

    >>> hypothesis_words("control_effectiveness@Cm:elevator")
    'effectiveness of the elevator on Cm'
    >>> hypothesis_words("beta_delay@all"), hypothesis_words("my_effect@Cl")
    ('delay of sideslip', 'my effect on Cl')
    """
    found = _HYPOTHESIS.fullmatch(identifier)
    return identifier if found is None else _phrase(*found.group("effect", "axes", "subject"))


def effect_words(finding: Mapping[str, Any]) -> str:
    """The name of a finding's effect in words, from an entry of ``findings`` or ``not_found``."""
    return hypothesis_words(finding["hypothesis"])


def parameter_name(text: str) -> str:
    """The name of a parameter as people write it: where a slope changes, in degrees.

    >>> parameter_name("Cm_alpha > 0.175"), parameter_name("CX_q")
    ('Cm_alpha above 10 deg', 'CX_q')
    """
    return _BREAK.sub(
        lambda found: f"{found['name']} above {math.degrees(float(found['value'])):.3g} deg", text
    )


def in_words(sentence: str) -> str:
    """A sentence of a document with names for the ids of hypotheses in it; what is to be typed
    stays.

    >>> in_words("it cannot be told from cross_rate@CY:r, beta_scale@all")
    'it cannot be told from the slope of CY with yaw rate, the scale of sideslip'
    >>> in_words("mend beta_scale@all, or --accept beta_scale@all")
    'mend the scale of sideslip, or --accept beta_scale@all'
    """
    named = _HYPOTHESIS.sub(
        lambda found: the(_phrase(*found.group("effect", "axes", "subject"))), sentence
    )
    powers = re.sub(r"(?:(?<=rad)|(?<=/s))\^([23])", lambda found: "²³"[int(found[1]) - 2], named)
    return parameter_name(powers)


def with_true_signs(sentence: str) -> str:
    """A sentence as pages write it: true minus signs, ± and →, raised powers of ten, three digits
    of numbers with many decimals.

    >>> with_true_signs("needs -3.18 (p = 5e-08) at 0.1-2 Hz, flight 2e4067391234")
    'needs −3.18 (p = 5×10⁻⁸) at 0.1-2 Hz, flight 2e4067391234'
    >>> with_true_signs("CZ_alpha -2.24 -> -2.48 +- 0.02 1/rad")
    'CZ_alpha −2.24 → −2.48 ± 0.02 1/rad'
    >>> with_true_signs("Kirchhoff(sharpness=199.87222782921273, lag=29.06042250254287)")
    'Kirchhoff(sharpness=200, lag=29.1)'
    >>> with_true_signs("error of Cm 0.00166 -> 0.0000901")
    'error of Cm 0.00166 → 0.0000901'
    """
    sentence = _LONG.sub(
        lambda found: found[0] if len(found[0].lstrip("0.")) <= 3 else f"{float(found[0]):.3g}",
        sentence,
    )
    raised = _POWER.sub(lambda found: f"{found[1]}{power_of_ten(int(found[2]))}", sentence)
    return _MINUS.sub("−", raised.replace("+-", "±").replace("->", "→"))


def rejected(finding: Mapping[str, Any]) -> dict[str, str]:
    """Rejected alternatives (ids) of a finding's document -> why, in display units.

    Documents of earlier releases hold the sentences alone; those are shown as they are.
    """
    data = {id: from_document(entry) for id, entry in finding.get("fallen_data", {}).items()}
    told = {id: in_display_units(remark).sentence for id, remark in data.items()}
    return {**finding.get("fallen", {}), **told}


def reasons_in_units(judged: Mapping[str, Any], units: UnitSystem | None = None) -> list[str]:
    """The reasons of a verdict in display units; as they were stored where only words were.

    judged : the document of a flight or of its consistency. units : as `shown_units` says where
    none are given.
    """
    remarks = [from_document(each) for each in judged.get("verdict_remarks", ())]
    return [in_display_units(each, units).sentence for each in remarks] or list(judged["reasons"])


def in_display_units(remark: Remark, units: UnitSystem | None = None) -> Remark:
    """A remark with its values in display units: degrees for radians.

    units : as `shown_units` says where none are given.

    >>> needed = {"value": (0.1, "rad/s"), "low": (-0.02, "rad/s"), "high": (0.02, "rad/s")}
    >>> remark = Remark("size_not_believable", ("the reconstruction",), needed)
    >>> in_display_units(remark).sentence
    'would need 5.73 deg/s, believable by the reconstruction is -1.15 to 1.15'
    """
    values = {}
    for name, (value, unit) in remark.values.items():
        factor, shown = for_people(unit, units)
        values[name] = (factor * value, unit if factor == 1.0 else shown)
    return replace(remark, values=values)


def advice_words(sentence: str) -> str:
    """As `in_words`, with names for the channels too: what to fly next, for who flies it.

    >>> advice_words("flap@CZ: move delta_flap; or state [measured.alpha_delay]")
    'the effectiveness of the flap on CZ: move flap; or state [measured.alpha_delay]'
    """
    return _CHANNEL.sub(lambda found: channel_words(found[0]), in_words(sentence))


def the(words: str) -> str:
    """The name of an effect with its article, for a sentence."""
    return f"the {words}"


def channel_words(name: str) -> str:
    """The name of a channel in words.

    >>> channel_words("delta_body_flap"), channel_words("q_hat")
    ('body flap', 'pitch rate')
    """
    return _WORDS.get(name, name.removeprefix("delta_").replace("_", " "))


def capital(text: str) -> str:
    """Return a sentence with a capital first letter."""
    return text[:1].upper() + text[1:]


def listed(entries: Sequence[str]) -> str:
    """Join entries to a list in a sentence; empty if there are none.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return f"{', '.join(entries[:-1])} and {entries[-1]}" if len(entries) > 1 else "".join(entries)


def _phrase(effect: str, axes: str, subject: str | None) -> str:
    where = "all axes" if axes == "all" else listed(axes.split("+"))
    if effect == "surface_asymmetry" and axes == "all":
        effect = "surface_lost"
    if effect == "stall_hysteresis" and subject == "loop":
        effect = "lift_hysteresis"
    if effect not in EFFECTS:
        of = f" of {channel_words(subject)}" if subject else ""
        return f"{effect.replace('_', ' ')}{of} on {where}"
    return EFFECTS[effect].format(axis=where, subject=_subject(effect, subject or ""))


def _subject(effect: str, subject: str) -> str:
    if effect in _ANGLES:
        return f"{math.degrees(float(subject)):.3g} deg"
    return channel_words(subject)
