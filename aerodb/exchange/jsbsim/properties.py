"""JSBSim's properties in terms of this product's channels, in SI and with its signs.

Signs: JSBSim's control derivatives use elevator and left aileron positive trailing edge down, and
rudder positive trailing edge left. Only the ailerons differ here (asymmetric deflection, (right -
left)/2): JSBSim's left aileron has a minus sign. Rates ``*-aero-*`` are relative to the air;
flights without gust rates give them as p, q, r.
"""

import math
import re
from typing import Final

from aerodb.tables import Expression, parse

FOOT: Final = 0.3048  # m, exact
INCH: Final = 0.0254  # m, exact
POUND_FORCE: Final = 4.4482216152605  # N, exact
PSF: Final = POUND_FORCE / FOOT**2  # Pa
SLUG_PER_FT3: Final = POUND_FORCE / FOOT**4  # kg/m3: a slug is 1 lbf s2/ft
SLUG: Final = POUND_FORCE / FOOT  # kg
POUNDS_PER_SLUG: Final = 32.174049  # weight in JSBSim, wherever it is
KNOT: Final = 1852.0 / 3600.0  # m/s, exact
DEGREES: Final = 180.0 / math.pi
RANKINE: Final = 1.8  # degrees Rankine of 1 K
#: Sutherland's viscosity as JSBSim has it (FGAtmosphere: 2.269690e-8 slug/(s ft R^0.5), 198.72 R).
_VISCOSITY: Final = (
    f"{2.269690e-8 * POUND_FORCE / FOOT**2 * RANKINE**0.5!r}*temperature^1.5"
    f"/({198.72 / RANKINE!r} + temperature)"
)
#: Sine of the angle of climb relative to the air (Stevens & Lewis, eq. 3.4-2).
_CLIMB: Final = (
    "cos(alpha)*cos(beta)*sin(theta) - sin(beta)*sin(phi)*cos(theta)"
    " - sin(alpha)*cos(beta)*cos(phi)*cos(theta)"
)

#: Components of the velocity along the body's axes.
_BODY: Final = {
    "u": "V*cos(alpha)*cos(beta)",
    "v": "V*sin(beta)",
    "w": "V*sin(alpha)*cos(beta)",
}

QBAR: Final = "aero/qbar-psf"
AREA: Final = "metrics/Sw-sqft"
SPAN: Final = "metrics/bw-ft"
CHORD: Final = "metrics/cbarw-ft"
LIFT_SQUARED: Final = "aero/cl-squared"
STALL_HYSTERESIS: Final = "aero/stall-hyst-norm"
WING_ALPHA: Final = "aero/alpha-wing-rad"
WING_INCIDENCE: Final = "metrics/iw-rad"

#: Properties that exports create: channels without a JSBSim property, free inputs and variables of
#: a database, its states with memory, and 1 while time passes.
OWN_CHANNEL: Final = "aerodb/channel/"
OWN_FREE: Final = "aerodb/free/"
OWN_VARIABLE: Final = "aerodb/variable/"
OWN_ARGUMENT: Final = "aerodb/argument/"
OWN_STATE: Final = "aerodb/state/"
TIME_PASSES: Final = "aerodb/time-passes"

#: Property -> expression of channels and the constants S_ref c_ref b_ref, in JSBSim's unit.
PROPERTIES: Final[dict[str, str]] = {
    QBAR: f"qbar/{PSF!r}",
    "aero/qbarUW-psf": f"qbar*cos(beta)^2/{PSF!r}",
    "aero/qbarUV-psf": f"qbar*((cos(alpha)*cos(beta))^2 + sin(beta)^2)/{PSF!r}",
    "aero/qbar-area": f"qbar*S_ref/{POUND_FORCE!r}",
    AREA: f"S_ref/{FOOT**2!r}",
    SPAN: f"b_ref/{FOOT!r}",
    CHORD: f"c_ref/{FOOT!r}",
    "aero/alpha-rad": "alpha",
    "aero/alpha-deg": f"alpha*{DEGREES!r}",
    "aero/beta-rad": "beta",
    "aero/beta-deg": f"beta*{DEGREES!r}",
    "aero/mag-beta-rad": "abs(beta)",
    "aero/mag-beta-deg": f"abs(beta)*{DEGREES!r}",
    "aero/alphadot-rad_sec": "alphadot",
    "aero/alphadot-deg_sec": f"alphadot*{DEGREES!r}",
    "aero/betadot-rad_sec": "betadot",
    "aero/betadot-deg_sec": f"betadot*{DEGREES!r}",
    "aero/bi2vel": "b_ref/(2*V)",
    "aero/ci2vel": "c_ref/(2*V)",
    "aero/h_b-cg-ft": "height_above_ground/b_ref",
    **{f"velocities/{rate}{kind}-rad_sec": rate for rate in "pqr" for kind in ("", "-aero")},
    "velocities/mach": "mach",
    "velocities/vt-fps": f"V/{FOOT!r}",
    **{
        f"velocities/{axis}{kind}-fps": f"{component}/{FOOT!r}"
        for axis, component in _BODY.items()
        for kind in ("", "-aero")  # the same without wind
    },
    "velocities/vc-kts": f"calibrated_airspeed/{KNOT!r}",
    "velocities/vc-fps": f"calibrated_airspeed/{FOOT!r}",
    "attitude/phi-rad": "phi",
    "attitude/roll-rad": "phi",
    "attitude/theta-rad": "theta",
    "attitude/pitch-rad": "theta",
    # As FlightGear calls them, from the root of its tree (FGInterface.cxx, _bind).
    **{
        f"velocities/{axis}Body-fps": f"{component}/{FOOT!r}"
        for axis, component in _BODY.items()  # the same without wind
    },
    "velocities/airspeed-kt": f"calibrated_airspeed/{KNOT!r}",
    "orientation/roll-deg": f"phi*{DEGREES!r}",
    "orientation/pitch-deg": f"theta*{DEGREES!r}",
    "orientation/heading-deg": f"psi*{DEGREES!r}",
    "orientation/alpha-deg": f"alpha*{DEGREES!r}",
    "orientation/side-slip-deg": f"beta*{DEGREES!r}",
    "orientation/side-slip-rad": "beta",
    "position/altitude-ft": f"altitude/{FOOT!r}",
    "position/altitude-agl-ft": f"height_above_ground/{FOOT!r}",
    "environment/density-slugft3": f"rho/{SLUG_PER_FT3!r}",
    "environment/temperature-degc": "temperature - 273.15",
    "atmosphere/rho-slugs_ft3": f"rho/{SLUG_PER_FT3!r}",
    "atmosphere/P-psf": f"static_pressure/{PSF!r}",
    "atmosphere/T-R": f"temperature*{RANKINE!r}",
    "atmosphere/a-fps": f"V/mach/{FOOT!r}",
    "aero/Re": f"V*c_ref*rho/({_VISCOSITY})",
    **{
        f"flight-path/gamma-{unit}": f"asin({_CLIMB}){scale}"
        for unit, scale in (("rad", ""), ("deg", f"*{DEGREES!r}"))
    },
    **{
        f"inertia/cg-{axis}-in": f"{sign}cg_{axis}/{INCH!r}"
        for axis, sign in (("x", "-"), ("y", ""), ("z", "-"))
    },
    "inertia/mass-slugs": f"mass/{SLUG!r}",
    "inertia/weight-lbs": f"mass*{POUNDS_PER_SLUG!r}/{SLUG!r}",
    "position/h-sl-ft": f"altitude/{FOOT!r}",
    "position/h-agl-ft": f"height_above_ground/{FOOT!r}",
    "gear/gear-pos-norm": "delta_landing_gear",
    **{
        f"fcs/{surface}-pos-{unit}": expression + scale
        for surface, expression in {
            "elevator": "delta_elevator",
            "mag-elevator": "abs(delta_elevator)",
            "left-aileron": "-delta_aileron",
            "mag-left-aileron": "abs(delta_aileron)",
            "right-aileron": "delta_aileron",
            "mag-right-aileron": "abs(delta_aileron)",
            "rudder": "delta_rudder",
            "mag-rudder": "abs(delta_rudder)",
            "flap": "delta_flap",
            "speedbrake": "delta_speedbrake",
            "spoiler": "delta_spoiler",
        }.items()
        for unit, scale in (("rad", ""), ("deg", f"*{DEGREES!r}"))
    },
}

#: Place of the moment reference in inches, in structural axes -> its index and sign in body axes.
AERO_REFERENCE: Final = {
    "metrics/aero-rp-x-in": (0, -1.0),
    "metrics/aero-rp-y-in": (1, 1.0),
    "metrics/aero-rp-z-in": (2, -1.0),
}

#: Channel -> property and scale to the channel's unit, for exports.
CHANNEL_PROPERTIES: Final[dict[str, tuple[str, float]]] = {
    "V": ("velocities/vt-fps", FOOT),
    "alpha": ("aero/alpha-rad", 1.0),
    "beta": ("aero/beta-rad", 1.0),
    "alphadot": ("aero/alphadot-rad_sec", 1.0),
    "betadot": ("aero/betadot-rad_sec", 1.0),
    "qbar": (QBAR, PSF),
    "mach": ("velocities/mach", 1.0),
    "rho": ("atmosphere/rho-slugs_ft3", SLUG_PER_FT3),
    "calibrated_airspeed": ("velocities/vc-fps", FOOT),
    **{rate: (f"velocities/{rate}-aero-rad_sec", 1.0) for rate in "pqr"},
    "phi": ("attitude/phi-rad", 1.0),
    "theta": ("attitude/theta-rad", 1.0),
    "altitude": ("position/h-sl-ft", FOOT),
    "height_above_ground": ("position/h-agl-ft", FOOT),
    "cg_x": ("inertia/cg-x-in", -INCH),
    "cg_y": ("inertia/cg-y-in", INCH),
    "cg_z": ("inertia/cg-z-in", -INCH),
    "delta_elevator": ("fcs/elevator-pos-rad", 1.0),
    "delta_aileron": ("fcs/left-aileron-pos-rad", -1.0),
    "delta_rudder": ("fcs/rudder-pos-rad", 1.0),
    "delta_flap": ("fcs/flap-pos-rad", 1.0),
    "delta_speedbrake": ("fcs/speedbrake-pos-rad", 1.0),
    "delta_spoiler": ("fcs/spoiler-pos-rad", 1.0),
    "delta_landing_gear": ("gear/gear-pos-norm", 1.0),
}


def height_of_reference_point(x: float, y: float, z: float) -> str:
    """Return ``aero/h_b-mac-ft``: height of the moment reference above ground over the span, a
    dimensionless expression of `CHANNELS`.

    x, y, z : moment reference [m], body axes.
    """
    below_cg = (
        f"-sin(theta)*({x!r} - cg_x) + cos(theta)*(sin(phi)*({y!r} - cg_y) + cos(phi)*({z!r} -"
        " cg_z))"
    )
    return f"(height_above_ground - ({below_cg}))/b_ref"


#: Where the properties of the aircraft are in the whole tree.
_OWN_ROOT: Final = "/fdm/jsbsim/"


def own_property(name: str) -> str:
    """Return a property from the root of the aircraft's own part of the tree, which is
    ``/fdm/jsbsim`` of the whole, in JSBSim alone and in FlightGear (FGFDMExec).

    >>> own_property("/fdm/jsbsim/fcs/flap-pos-deg"), own_property("-fcs/flap-pos-deg")
    ('fcs/flap-pos-deg', '-fcs/flap-pos-deg')
    """
    return name.replace(_OWN_ROOT, "", 1) if name.lstrip("-").startswith(_OWN_ROOT) else name


def property_description(name: str, note: str = "") -> str:
    """Return the description of the input or variable that a property becomes."""
    return f"{_PROPERTY}{name}{note and f': {note}'}"


def described_property(description: str) -> str:
    """Return the property of a `property_description`; empty for another description.

    Stored databases hold the property there alone.

    >>> described_property(property_description("fcs/flap-pos-norm", "a flap"))
    'fcs/flap-pos-norm'
    """
    found = _DESCRIBED.match(description)
    return found[1] if found else ""


_PROPERTY: Final = "JSBSim property "
_DESCRIBED: Final = re.compile(rf"{_PROPERTY}(\S+?)(?::|$)")


def hysteresis_description(low: float, high: float) -> str:
    """Return the description of a free input that is JSBSim's stall hysteresis.

    low, high : angles of attack [rad] between which the relay keeps its state (`hysteresis_limits`
    reads them back).
    """
    relay = f"relay on alpha, 1 above {high!r} rad, 0 below {low!r} rad, in between as it was"
    return property_description(STALL_HYSTERESIS, relay)


_HYSTERESIS_TEXT = re.compile(
    re.escape(property_description(STALL_HYSTERESIS, "relay on alpha, 1 above "))
    + r"(\S+) rad, 0 below (\S+) rad,.*"
)


def hysteresis_limits(text: str) -> tuple[float, float] | None:
    """Return low and high angle of attack [rad] of a `hysteresis_description`; otherwise None.

    >>> hysteresis_limits(hysteresis_description(0.1, 0.3))
    (0.1, 0.3)
    """
    match = _HYSTERESIS_TEXT.fullmatch(text)
    return (float(match[2]), float(match[1])) if match else None


def property_expression(name: str) -> Expression | None:
    """Return what a property means in channels; None where that depends on the aircraft's file, or
    is not known (`PROPERTIES`, JSBSim's units of each).

    >>> str(property_expression("aero/mag-beta-rad"))
    'abs(beta)'
    """
    return parse(PROPERTIES[name]) if name in PROPERTIES else None


def property_unit(name: str) -> str:
    """Return the unit that the end of a property's name states, in pint's spelling; '' where it
    states none (`_UNIT_ENDINGS`).

    >>> property_unit("fcs/flap-pos-deg"), property_unit("velocities/vt-fps")
    ('deg', 'ft/s')
    """
    return _UNIT_ENDINGS.get(name.rsplit("/", 1)[-1].rpartition("-")[2], "")


_UNIT_ENDINGS: Final = {
    **{unit: unit for unit in ("rad", "deg", "ft", "m", "psf", "lbs")},
    "rad_sec": "rad/s",
    "deg_sec": "deg/s",
    "fps": "ft/s",
    "mps": "m/s",
    "kts": "knot",
    "in": "inch",
    "sqft": "ft^2",
    "slugs": "slug",
    "slugs_ft3": "slug/ft^3",
}


def property_identifier(name: str) -> str:
    """Return the identifier of a property that becomes a free input.

    A property that an export made keeps its name in the database.
    """
    if name == STALL_HYSTERESIS:
        return "stall_hyst_norm"
    for prefix in (OWN_FREE, OWN_VARIABLE):
        if name.startswith(prefix):
            return name.removeprefix(prefix)
    return name
