"""Consequences of missing channels in plain words, for `log inspect`."""

from collections.abc import Sequence

#: Alternatives of which at least one is needed -> consequence when all of them are missing.
_CONSEQUENCES: tuple[tuple[tuple[str, ...], str], ...] = (
    (("qbar", "V"), "no dynamic pressure and no airspeed: no coefficient can be computed"),
    (("ax", "ax_imu"), "no forward acceleration: CX and C_drag cannot be computed"),
    (("ay", "ay_imu"), "no lateral acceleration: CY cannot be computed"),
    (("az", "az_imu"), "no normal acceleration: CZ and C_lift cannot be computed"),
    (("p", "pdot"), "no roll rate: Cl cannot be computed, Cm and Cn only without coupling"),
    (("q", "qdot"), "no pitch rate: Cm cannot be computed, Cl and Cn only without coupling"),
    (("r", "rdot"), "no yaw rate: Cn cannot be computed, Cl and Cm only without coupling"),
    (("alpha",), "no angle of attack: no comparison against tables over alpha, no lift and drag"),
    (("beta",), "no angle of sideslip: no comparison of CY, Cl and Cn against tables over beta"),
    (("V",), "no true airspeed: no non-dimensional rates, so no damping derivatives"),
    (
        ("mach",),
        (
            "no Mach number: tables over Mach need one from the standard atmosphere, or cannot be"
            " used"
        ),
    ),
    (("phi",), "no bank angle: no flight-path reconstruction"),
    (("theta",), "no pitch attitude: no flight-path reconstruction"),
    (
        ("velocity_north",),
        "no velocity over the earth: wind cannot be estimated, nor airspeed checked against it",
    ),
    (("altitude",), "no altitude: no check of the vertical motion, no standard atmosphere"),
    (
        ("thrust", "thrust_left"),
        "no thrust: CX of a powered vehicle includes thrust as well as drag",
    ),
    (("height_above_ground",), "no height above ground: ground effect cannot be examined"),
)


def consequences_of_missing(missing: Sequence[str]) -> list[str]:
    """Return what cannot be computed without the `missing` channels (`Flight.missing`).

    One sentence each, the most serious first.

    >>> consequences_of_missing(["beta"])
    ['no angle of sideslip: no comparison of CY, Cl and Cn against tables over beta']
    """
    lacking = set(missing)
    sentences = [
        sentence for alternatives, sentence in _CONSEQUENCES if lacking.issuperset(alternatives)
    ]
    surfaces = sorted(name.removeprefix("delta_") for name in lacking if name.startswith("delta_"))
    if surfaces:
        sentences.append(f"no position of {', '.join(surfaces)}: no control effectiveness of these")
    return sentences


def airspeed_remedy(missing: Sequence[str]) -> list[str]:
    """Return what to do where the log has no airspeed; empty where it has one.

    >>> airspeed_remedy(["V", "alpha"])
    []
    """
    if not {"qbar", "V"} <= set(missing):
        return []
    return [
        "airspeed comes from a pitot tube that is logged (airspeed_validated of PX4), or from a"
        " field that you map (aerodb mapping init), not from the speed over the ground"
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
