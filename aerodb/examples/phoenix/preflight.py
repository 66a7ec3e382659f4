"""Formulas behind preflight.toml. INVENTED: they contain no measured or published Phoenix table.

The form is eq. 6 of the Phoenix paper: tables over angle of attack and deflection, even effects of
asymmetric deflections, uncertainty factors UD and UF at their nominal values, landing gear, ground
effect, and rates over L_ref/V. The numbers are chosen so that the vehicle has the properties that
the paper states: glide ratio near 5.5, unstable in pitch, time to double below 0.5 s.
`preflight_text` writes preflight.toml; a test keeps the two equal.
"""

from collections.abc import Callable, Sequence

import numpy as np

from aerodb.support import Array

_ELEVON: list[float] = [-25, -15, -10, -5, 0, 5, 10, 15, 25]
_ASYMMETRIC: list[float] = [0, 5, 10, 15, 25]
#: Table argument -> unit (empty: SI) and breakpoints.
BREAKPOINTS: dict[str, tuple[str, list[float]]] = {
    "alpha": ("deg", [-8, -4, -2, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 24]),
    "dEO": ("deg", _ELEVON),
    "dEI": ("deg", _ELEVON),
    "dAO": ("deg", _ASYMMETRIC),
    "dAI": ("deg", _ASYMMETRIC),
    "dRU": ("deg", [-20, -10, 0, 10, 20]),
    "dBF": ("deg", [-12, -5, 0, 5, 10, 22]),
    "dSB": ("deg", [-1, 0, 10, 20, 30, 42]),
    "hAGL": ("", [0, 1, 2, 3, 5, 8, 12, 20, 3000]),
}

Shape = Callable[..., Array]


def near_ground(h: Array) -> Array:
    """Return the fraction of the ground effect at height `h` [m]: zero from 20 m on."""
    return np.where(h < 20, np.exp(-h / 3), 0.0)


def lift(a: Array) -> Array:
    """Return the lift coefficient of the clean vehicle at angle of attack `a` [rad].

    The vehicle is a slender wing with some vortex lift.
    """
    return -0.02 + 2.1 * a + 0.6 * a * np.abs(a)


def drag(a: Array) -> Array:
    """Return the drag coefficient of the clean vehicle, a parabolic polar.

    a : angle of attack (n,) [rad].
    """
    return 0.042 + 0.175 * lift(a) ** 2


def _flap_x(friction: float, induced: float, lift_slope: float) -> Shape:
    """CX of a trailing-edge flap: its drag, induced drag with alpha, and the tilt of its lift."""
    return lambda a, d: (
        -(friction * d**2 + induced * a * d) * np.cos(a) + lift_slope * d * np.sin(a)
    )


def _odd(slope: float) -> Shape:
    """Odd effect of a deflection, smaller at large deflection and slightly smaller with alpha."""
    return lambda a, d: slope * d * (1 - 0.6 * d**2) * (1 - 0.5 * a**2)


#: name -> (arguments, formula), with the names of eq. 6, axis by axis. Prefix D: increments by
#: deflection; d: derivatives.
TABLES: dict[str, tuple[tuple[str, ...], Shape]] = {
    "CX_0": (("alpha",), lambda a: -drag(a) * np.cos(a) + lift(a) * np.sin(a)),
    "DCX_EO": (("alpha", "dEO"), _flap_x(0.05, 0.23, 0.32)),
    "DCX_EI": (("alpha", "dEI"), _flap_x(0.06, 0.30, 0.42)),
    "DCX_AO": (("alpha", "dAO"), lambda a, d: -0.05 * d**2 + 0 * a),
    "DCX_AI": (("alpha", "dAI"), lambda a, d: -0.06 * d**2 + 0 * a),
    "DCX_RU": (("alpha", "dRU"), lambda a, d: -0.04 * d**2 + 0 * a),
    "DCX_BF": (("alpha", "dBF"), _flap_x(0.03, 0.09, 0.12)),
    "DCX_SB": (("alpha", "dSB"), lambda a, d: -(0.080 * d + 0.025 * d**2) * (1 + 0.4 * a)),
    "dCX_beta": (("alpha",), lambda a: -0.015 - 0.05 * a),
    "DCX_LG": (("alpha",), lambda a: -0.018 + 0.02 * a),
    "DCX_GE": (("alpha", "hAGL"), lambda a, h: 0.06 * a * near_ground(h)),
    "CZ_0": (("alpha",), lambda a: -lift(a) * np.cos(a) - drag(a) * np.sin(a)),
    "dCZ_alpha": (("alpha",), lambda a: -2.1 - 0.6 * np.abs(a)),
    "DCZ_EO": (("alpha", "dEO"), _odd(-0.32)),
    "DCZ_EI": (("alpha", "dEI"), _odd(-0.42)),
    "DCZ_AO": (("alpha", "dAO"), lambda a, d: 0.02 * d * (1 + a)),
    "DCZ_AI": (("alpha", "dAI"), lambda a, d: 0.03 * d * (1 + a)),
    "DCZ_RU": (("alpha", "dRU"), lambda a, d: 0.01 * np.abs(d) * (1 + a)),
    "DCZ_BF": (("alpha", "dBF"), _odd(-0.12)),
    "DCZ_SB": (("alpha", "dSB"), lambda a, d: 0.015 * d * (1 + a)),
    "dCZ_beta": (("alpha",), lambda a: 0.06 + 0.2 * a),
    "DCZ_LG": (("alpha",), lambda a: 0.004 + 0.02 * a),
    "dCZ_LG_beta": (("alpha",), lambda a: 0.02 + 0 * a),
    "DCZ_GE": (("alpha", "hAGL"), lambda a, h: -0.35 * a * near_ground(h)),
    "dCZ_q": (("alpha",), lambda a: -1.0 - 0.5 * a),
    "Cm_0": (("alpha",), lambda a: 0.002 + 0.050 * a + 0.02 * a * np.abs(a)),
    "DCm_EO": (("alpha", "dEO"), _odd(-0.105)),
    "DCm_EI": (("alpha", "dEI"), _odd(-0.125)),
    "DCm_AO": (("alpha", "dAO"), lambda a, d: 0.006 * d + 0 * a),
    "DCm_AI": (("alpha", "dAI"), lambda a, d: 0.008 * d + 0 * a),
    "DCm_BF": (("alpha", "dBF"), _odd(-0.052)),
    "DCm_SB": (("alpha", "dSB"), lambda a, d: 0.012 * d * (1 - a)),
    "dCm_beta": (("alpha",), lambda a: -0.01 + 0 * a),
    "DCm_LG": (("alpha",), lambda a: -0.004 + 0.01 * a),
    "DCm_GE": (("alpha", "hAGL"), lambda a, h: -0.03 * a * near_ground(h)),
    "dCm_q": (("alpha",), lambda a: -0.34 - 0.1 * a),
    "dCY_beta": (("alpha",), lambda a: -0.50 - 0.2 * a),
    "DCY_RU": (("alpha", "dRU"), _odd(0.18)),
    "dCY_p": (("alpha",), lambda a: 0.02 + 0.1 * a),
    "dCY_r": (("alpha",), lambda a: 0.15 + 0 * a),
    "dCl_beta": (("alpha",), lambda a: -0.045 - 0.16 * a),
    "DCl_AO": (("alpha", "dAO"), _odd(-0.085)),
    "DCl_AI": (("alpha", "dAI"), _odd(-0.045)),
    "DCl_RU": (("alpha", "dRU"), _odd(0.012)),
    "dCl_p": (("alpha",), lambda a: -0.12 + 0.05 * a),
    "dCl_r": (("alpha",), lambda a: 0.02 + 0.2 * a),
    "dCn_beta": (("alpha",), lambda a: 0.10 - 0.08 * a),
    "DCn_AO": (("alpha", "dAO"), lambda a, d: 0.02 * a * d),
    "DCn_AI": (("alpha", "dAI"), lambda a, d: 0.01 * a * d),
    "DCn_RU": (("alpha", "dRU"), _odd(-0.085)),
    "dCn_p": (("alpha",), lambda a: -0.01 - 0.08 * a),
    "dCn_r": (("alpha",), lambda a: -0.20 + 0 * a),
    "dCn_LG_beta": (("alpha",), lambda a: -0.006 + 0 * a),
}

#: Names in tables and terms -> canonical channels (Phoenix paper, below eq. 6; UD and UF:
#: uncertainty factors).
VARIABLES = {
    "dEO": "delta_elevator_outboard",
    "dEI": "delta_elevator_inboard",
    "dAO": "delta_aileron_outboard",
    "dAI": "delta_aileron_inboard",
    "dRU": "delta_rudder",
    "dBF": "delta_body_flap",
    "dSB": "delta_speed_brake",
    "dLG": "delta_landing_gear",
    "hAGL": "height_above_ground",
    "UD": "0.0",
    "UF": "1.0",
    "p_ref": "p*b_ref/V",
    "q_ref": "q*c_ref/V",
    "r_ref": "r*b_ref/V",
}

#: axis -> its terms.
RULES: dict[str, tuple[str, ...]] = {
    "CX": (
        *(
            "CX_0(alpha)",
            "DCX_EO(alpha, dEO)",
            "DCX_EI(alpha, dEI)",
            "DCX_AO(alpha, abs(dAO))",
            "DCX_AI(alpha, abs(dAI))",
        ),
        *(
            "DCX_RU(alpha, dRU)",
            "DCX_BF(alpha, dBF)",
            "UF*DCX_SB(alpha, dSB)",
            "dCX_beta(alpha)*abs(beta)",
        ),
        *("DCX_LG(alpha)*dLG", "DCX_GE(alpha, hAGL)"),
    ),
    "CZ": (
        *(
            "CZ_0(alpha)",
            "UD*dCZ_alpha(alpha)*alpha",
            "DCZ_EO(alpha, dEO)",
            "DCZ_EI(alpha, dEI)",
            "DCZ_AO(alpha, abs(dAO))",
        ),
        *(
            "DCZ_AI(alpha, abs(dAI))",
            "DCZ_RU(alpha, dRU)",
            "DCZ_BF(alpha, dBF)",
            "UF*DCZ_SB(alpha, dSB)",
        ),
        *(
            "(dCZ_beta(alpha) + dCZ_LG_beta(alpha)*dLG)*abs(beta)",
            "DCZ_LG(alpha)*dLG",
            "DCZ_GE(alpha, hAGL)",
        ),
        "dCZ_q(alpha)*q_ref",
    ),
    "Cm": (
        *(
            "Cm_0(alpha)",
            "DCm_EO(alpha, dEO)",
            "DCm_EI(alpha, dEI)",
            "DCm_AO(alpha, abs(dAO))",
            "DCm_AI(alpha, abs(dAI))",
        ),
        *(
            "DCm_BF(alpha, dBF)",
            "UF*DCm_SB(alpha, dSB)",
            "dCm_beta(alpha)*abs(beta)",
            "DCm_LG(alpha)*dLG",
        ),
        *("DCm_GE(alpha, hAGL)", "dCm_q(alpha)*q_ref"),
    ),
    "CY": (
        "dCY_beta(alpha)*beta",
        "DCY_RU(alpha, dRU)",
        "dCY_p(alpha)*p_ref",
        "dCY_r(alpha)*r_ref",
    ),
    "Cl": (
        *(
            "dCl_beta(alpha)*beta",
            "sign(dAO)*DCl_AO(alpha, abs(dAO))",
            "sign(dAI)*DCl_AI(alpha, abs(dAI))",
        ),
        *("DCl_RU(alpha, dRU)", "dCl_p(alpha)*p_ref", "dCl_r(alpha)*r_ref"),
    ),
    "Cn": (
        *("(dCn_beta(alpha) + dCn_LG_beta(alpha)*dLG)*beta", "sign(dAO)*DCn_AO(alpha, abs(dAO))"),
        *(
            "sign(dAI)*DCn_AI(alpha, abs(dAI))",
            "DCn_RU(alpha, dRU)",
            "dCn_p(alpha)*p_ref",
            "dCn_r(alpha)*r_ref",
        ),
    ),
}


#: Position and lengths as in vehicle.toml: the aerodynamic reference point AC of the Phoenix paper.
_HEADER = """\
# INVENTED aerodynamics of a Phoenix-like demonstrator; no number is measured or published. \
The form is that of eq. 6 in
# "Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight Test".
# Written by aerodb.examples.phoenix.preflight; a test keeps formulas and file equal.
name = "phoenix-preflight"
description = "invented preflight database of the built-in example"
source = "aerodb.examples.phoenix.preflight"

[reference]
area = 10.3
chord = 6.0
span = 3.48
moment_reference = [-3.8, 0.0, 0.0]

[variables]
"""


def table_values(name: str) -> Array:
    """Return the node values of a table, rounded to the 6 decimals that are written.

    One dimension per argument of the table; the coefficient has no unit. Raises KeyError for an
    unknown name.
    """
    arguments, formula = TABLES[name]
    axes = [
        np.deg2rad(points) if unit == "deg" else np.array(points)
        for unit, points in map(BREAKPOINTS.__getitem__, arguments)
    ]
    rounded: Array = np.round(formula(*np.meshgrid(*axes, indexing="ij")), 6) + 0.0
    return rounded


def preflight_text() -> str:
    """Return the text of preflight.toml."""
    lines = [_HEADER.rstrip("\n")]
    lines += [
        f'{name} = {{ expression = "{expression}" }}' for name, expression in VARIABLES.items()
    ]
    for name, (arguments, _) in TABLES.items():
        lines += ["", f"[tables.{name}]", f"arguments = {_quoted(arguments)}"]
        lines.append(f"units = {_quoted([BREAKPOINTS[a][0] for a in arguments])}")
        lines.append(f"breakpoints = [{', '.join(str(BREAKPOINTS[a][1]) for a in arguments)}]")
        values = table_values(name).tolist()
        rows = [f"  {row}," for row in values]
        lines += ["values = [", *rows, "]"] if len(arguments) > 1 else [f"values = {values}"]
    for axis, rules in RULES.items():
        for number, rule in enumerate(rules, 1):
            lines += [
                "",
                "[[terms]]",
                f'name = "{axis}_{number:02d}"',
                f'axis = "{axis}"',
                f'expression = "{rule}"',
            ]
    return "\n".join(lines) + "\n"


def _quoted(words: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{word}"' for word in words) + "]"
