"""Consequences of missing channels in plain words, for `log inspect`."""

from collections.abc import Sequence
from typing import Final

#: Alternatives of which at least one is needed -> what is not possible when all of them are
#: missing, in short and in a sentence.
_CONSEQUENCES: Final[tuple[tuple[tuple[str, ...], str, str], ...]] = (
    (
        ("qbar", "V"),
        "coefficients",
        "no dynamic pressure and no airspeed: no coefficient can be computed",
    ),
    (("ax", "ax_imu"), "CX and drag", "no forward acceleration: CX and C_drag cannot be computed"),
    (("ay", "ay_imu"), "CY", "no lateral acceleration: CY cannot be computed"),
    (("az", "az_imu"), "CZ and lift", "no normal acceleration: CZ and C_lift cannot be computed"),
    (("p", "pdot"), "Cl", "no roll rate: Cl cannot be computed, Cm and Cn only without coupling"),
    (("q", "qdot"), "Cm", "no pitch rate: Cm cannot be computed, Cl and Cn only without coupling"),
    (("r", "rdot"), "Cn", "no yaw rate: Cn cannot be computed, Cl and Cm only without coupling"),
    (
        ("alpha",),
        "tables over alpha, lift and drag",
        "no angle of attack: no comparison against tables over alpha, no lift and drag",
    ),
    (
        ("beta",),
        "tables over beta",
        "no angle of sideslip: no comparison of CY, Cl and Cn against tables over beta",
    ),
    (
        ("V",),
        "damping derivatives",
        "no true airspeed: no non-dimensional rates, so no damping derivatives",
    ),
    (
        ("mach",),
        "tables over Mach",
        "no Mach number: tables over Mach need one from the standard atmosphere, or cannot be used",
    ),
    (("phi",), "flight-path reconstruction", "no bank angle: no flight-path reconstruction"),
    (("theta",), "flight-path reconstruction", "no pitch attitude: no flight-path reconstruction"),
    (
        ("velocity_north",),
        "wind",
        "no velocity over the earth: wind cannot be estimated, nor airspeed checked against it",
    ),
    (
        ("altitude",),
        "check of the vertical motion",
        "no altitude: no check of the vertical motion, no standard atmosphere",
    ),
    (
        ("thrust", "thrust_left"),
        "drag apart from thrust",
        "no thrust: CX of a powered vehicle includes thrust as well as drag",
    ),
    (
        ("height_above_ground",),
        "ground effect",
        "no height above ground: ground effect cannot be examined",
    ),
)


def not_possible(missing: Sequence[str]) -> list[tuple[str, str]]:
    """Return what is not possible without the `missing` channels (`Flight.missing`): in short, and
    in a sentence with the reason; the most serious first.

    >>> [short for short, _ in not_possible(["beta", "delta_flap", "height_above_ground"])]
    ['tables over beta', 'ground effect', 'effectiveness of flap']
    """
    lacking = set(missing)
    found = [
        (short, sentence)
        for alternatives, short, sentence in _CONSEQUENCES
        if lacking.issuperset(alternatives)
    ]
    surfaces = sorted(name.removeprefix("delta_") for name in lacking if name.startswith("delta_"))
    if surfaces:
        named = ", ".join(surfaces)
        sentence = f"no position of {named}: no control effectiveness of these"
        found.append((f"effectiveness of {named.replace('_', ' ')}", sentence))
    return found


def consequences_of_missing(missing: Sequence[str]) -> list[str]:
    """Return the sentences of `not_possible`.

    >>> consequences_of_missing(["beta"])
    ['no angle of sideslip: no comparison of CY, Cl and Cn against tables over beta']
    """
    return [sentence for _, sentence in not_possible(missing)]


def airspeed_remedy(missing: Sequence[str]) -> list[str]:
    """Return what to do where the log has no airspeed; empty where it has one.

    >>> airspeed_remedy(["V", "alpha"])
    []
    """
    if not {"qbar", "V"} <= set(missing):
        return []
    return [
        "airspeed comes from a logged pitot tube (airspeed_validated of PX4) or a field that you"
        " map (aerodb mapping init), not from the ground speed"
    ]


#: What moves with the aircraft: zero throughout, it was not recorded; no constant stands for it.
_MOTION = (
    *("p", "q", "r", "pdot", "qdot", "rdot", "ax", "ay", "az", "ax_imu", "ay_imu", "az_imu"),
    *("alpha", "beta", "alphadot", "betadot", "phi", "theta", "psi", "V", "qbar", "mach"),
)


def consequence_of_zeros(channels: Sequence[str], dropped: bool) -> list[str]:
    """Return what to do about channels that are zero throughout, one sentence for what moves and
    one for what may be constant; empty if there is none.

    dropped : whether the mapping counts them as not recorded. See `zero_channels`.

    >>> consequence_of_zeros(["thrust"], True)[0][:44]
    'thrust is zero throughout: not recorded, and'
    """
    counted = "not recorded, and not used" if dropped else "not recorded, perhaps"
    moving = [name for name in channels if name in _MOTION]
    constant = [name for name in channels if name not in _MOTION]
    sentences = [f"{_zero(moving)}: {counted}"] if moving else []
    if constant:
        them = "them" if len(constant) > 1 else "it"
        sentences.append(
            f"{_zero(constant)}: {counted}; state {them} in [configuration] of the vehicle file if"
            f" constant, or map the fields that hold {them}"
        )
    return sentences


def _zero(channels: Sequence[str]) -> str:
    named = " and ".join(filter(None, [", ".join(channels[:-1]), channels[-1]]))
    return f"{named} {'are' if len(channels) > 1 else 'is'} zero throughout"
