"""JSBSim's axes: the frame in which a function acts, the axes it contributes to, and its factors.

There are four systems of force axes: DRAG SIDE LIFT, X Y Z in body axes, AXIAL SIDE NORMAL, and X Y
Z with a ``frame``. In the frames STABILITY and WIND, JSBSim reverses the signs of x and z of forces
before it rotates them: X is then drag, aft, and Z lift, up. Moments have frames too, without this
reversal.
"""

from collections.abc import Iterable
from typing import Any, Final

from aerodb.errors import InputError, nearest
from aerodb.exchange.jsbsim.properties import AREA, CHORD, QBAR, SPAN

_FORCE: Final = (QBAR, AREA)

#: Axis -> properties that a function on it has as factors.
FACTORS: Final[dict[str, tuple[str, ...]]] = {
    **dict.fromkeys(("C_drag", "C_side", "C_lift", "CX", "CY", "CZ"), _FORCE),
    "Cl": (*_FORCE, SPAN),
    "Cm": (*_FORCE, CHORD),
    "Cn": (*_FORCE, SPAN),
}

Shares = tuple[tuple[str, str], ...]

#: JSBSim axis -> axis here, with its factor.
_PLAIN: Final[dict[str, Shares]] = {
    "DRAG": (("C_drag", "1"),),
    "SIDE": (("C_side", "1"),),
    "LIFT": (("C_lift", "1"),),
    "X": (("CX", "1"),),
    "Y": (("CY", "1"),),
    "Z": (("CZ", "1"),),
    "AXIAL": (("CX", "-1"),),
    "NORMAL": (("CZ", "-1"),),
    "ROLL": (("Cl", "1"),),
    "PITCH": (("Cm", "1"),),
    "YAW": (("Cn", "1"),),
}
_STABILITY: Final[dict[str, Shares]] = {
    "X": (("CX", "-cos(alpha)"), ("CZ", "-sin(alpha)")),
    "Y": (("CY", "1"),),
    "Z": (("CX", "sin(alpha)"), ("CZ", "-cos(alpha)")),
    "ROLL": (("Cl", "cos(alpha)"), ("Cn", "sin(alpha)")),
    "PITCH": (("Cm", "1"),),
    "YAW": (("Cl", "-sin(alpha)"), ("Cn", "cos(alpha)")),
}
_WIND: Final[dict[str, Shares]] = {
    "X": _PLAIN["DRAG"],
    "Y": _PLAIN["SIDE"],
    "Z": _PLAIN["LIFT"],
    "ROLL": (("Cl", "cos(alpha)*cos(beta)"), ("Cm", "sin(beta)"), ("Cn", "sin(alpha)*cos(beta)")),
    "PITCH": (
        ("Cl", "-(cos(alpha)*sin(beta))"),
        ("Cm", "cos(beta)"),
        ("Cn", "-(sin(alpha)*sin(beta))"),
    ),
    "YAW": (("Cl", "-sin(alpha)"), ("Cn", "cos(alpha)")),
}
_FRAMES: Final = {"": _PLAIN, "BODY": _PLAIN, "STABILITY": _STABILITY, "WIND": _WIND}
_FRAMED: Final = ("X", "Y", "Z", "ROLL", "PITCH", "YAW")
_MOMENTS: Final = ("ROLL", "PITCH", "YAW")
_SYSTEMS: Final = ({"DRAG", "SIDE", "LIFT"}, {"X", "Y", "Z"}, {"AXIAL", "SIDE", "NORMAL"})

#: JSBSim ignores the unit of an axis: it always assumes pounds and foot-pounds.
_POUNDS: Final = {"", "LB", "LBS", "LBF", "LBFT", "LBSFT", "FTLB", "FTLBS", "LBFFT", "FTLBF"}


def axis_frame(element: Any, where: str) -> tuple[str, str]:
    """Return name and frame ('' for body axes) of an ``<axis>``.

    Raises InputError for unknown names, frames and units.
    """
    axis, frame, unit = (element.get(key, "") for key in ("name", "frame", "unit"))
    if axis not in _PLAIN:
        raise InputError(f"axis '{axis}'", where, nearest(axis, _PLAIN))
    unknown = set(element.attrib) - {"name", "frame", "unit"}
    if unknown or frame not in _FRAMES or (frame and axis not in _FRAMED):
        raise InputError(f"unsupported attributes of axis {axis}: {dict(element.attrib)}", where)
    if "".join(filter(str.isalpha, unit)).upper() not in _POUNDS:
        raise InputError(
            f"unit '{unit}' of axis {axis}",
            where,
            "JSBSim ignores the unit and assumes pounds and foot-pounds",
        )
    return axis, "" if frame == "BODY" else frame


def axis_shares(axis: str, frame: str) -> Shares:
    """Return the axes that a function on `axis` in `frame` contributes to.

    Each axis comes with its factor as an expression, dimensionless. KeyError for an unknown frame
    or axis (`check_systems`).
    """
    return _FRAMES[frame][axis]


def check_systems(acting: Iterable[tuple[str, str, str]], where: str) -> None:
    """Raise InputError unless the force axes, and the moment axes, each belong to one frame.

    The force axes must also belong to one system.

    acting : axis, frame and function of each function (`_SYSTEMS`).
    """
    systems = list(acting)
    forces = {axis for axis, _, _ in systems if axis not in _MOMENTS}
    if not any(forces <= system for system in _SYSTEMS):
        raise InputError(f"force axes of different systems: {', '.join(sorted(forces))}", where)
    for moment in (False, True):
        frames = {frame or "BODY" for axis, frame, _ in systems if (axis in _MOMENTS) == moment}
        if len(frames) > 1:
            raise InputError(
                f"{'moments' if moment else 'forces'} in different frames:"
                f" {', '.join(sorted(frames))}",
                where,
            )


def body_forces(drag: str, side: str, lift: str) -> dict[str, str]:
    """Return CX, CY, CZ as expressions of three identifiers, as `wind_to_body` computes them.

    Angles are in rad.
    """
    along = f"({drag}*cos(beta) + {side}*sin(beta))"
    return {
        "CX": f"{lift}*sin(alpha) - {along}*cos(alpha)",
        "CY": f"{side}*cos(beta) - {drag}*sin(beta)",
        "CZ": f"-{along}*sin(alpha) - {lift}*cos(alpha)",
    }
