"""A helicopter with a hingeless rotor: vehicle and databases of docs/guides/helicopter.md, and their data as
numbers for equations of their own.

The rotor has the size of the EC 135 (radius 5.1 m, 395 rpm, four blades: EASA type certificate data
sheet R.009). Its blades are those of the Bo 105 (Padfield, Helicopter Flight Dynamics, table 4B.2): Lock
number 5.087, flap frequency ratio squared 1.248, solidity .07, lift slope 6.113, linear twist -.14 rad,
rotor 1.48 m above the centre of gravity, moments of inertia. Apparent masses and gains of the
inflow are those of Pitt and Peters (Vertica 5(1), 1981): 128/(75 pi), 16/(45 pi), 1/2 and 2 in hover.

Azimuth 0 is aft, the blades turn anticlockwise from above; flap is b0 + bc cos + bs sin, up; inflow
is l0 + r (ls sin + lc cos), down. X and Y are bc' - q/Omega and bs' - p/Omega: so no angular acceleration
enters, and the rates of the tip path plane to the air are -Y and -X.
"""

from typing import Final

from tests.support.guide_flights import blocks
from tests.support.paths import ROOT

RADIUS, OMEGA, BLADES = 5.1, 41.4, 4
SOLIDITY, SLOPE, LOCK, FREQUENCY, TWIST = 0.07, 6.113, 5.087, 1.248, -0.14
HEIGHT, MASS = 1.48, 2700.0
INERTIA: Final = {"Ixx": 1433.0, "Iyy": 4973.0, "Izz": 4099.0, "Ixz": 660.0}
RHO: Final = 1.2
#: Flap inertia of a blade [kg m2], and spring at its root [N m/rad].
FLAP: Final = 1.225 * SLOPE * (SOLIDITY * 3.141592653589793 * RADIUS / BLADES) * RADIUS**4 / LOCK
SPRING: Final = (FREQUENCY - 1.0) * FLAP * OMEGA**2
#: Tail rotor: thrust per pedal [N/rad], behind the CG [m]. Fuselage: drag areas [m2], and yaw.
TAIL, TAIL_ARM, TAIL_HEIGHT = 15000.0, 6.0, 0.5
FUSELAGE: Final = (1.5, 6.0, 5.0)
#: Reference area [m2], span [m], and the weathercock to the left and to the right of the flow, held beyond [rad].
AREA, SPAN, WEATHERCOCK, FIN_LIMIT = 81.7, 10.2, (0.024, 0.042), 0.349
_GUIDE: Final = (ROOT / "docs" / "guides" / "helicopter.md").read_text(encoding="utf-8")
_FILES: Final = {title: text for _, title, text in blocks(_GUIDE) if title}
VEHICLE, DERIVATIVES, LATERAL = (_FILES[f"{name}.toml"] for name in ("ec135", "cruise", "lateral"))


def database(kp: float, kq: float, theory: str = "") -> str:
    """The guide's rotor with these wake distortion parameters, and what theory has for them."""
    text = _FILES["rotor.toml"]
    for name, value in (("Kp", kp), ("Kq", kq)):
        begin = f"{name} = {{ value = "
        assert text.count(f"{begin}0.0,") == 1, "the guide's rotor has no wake distortion"
        told = f" theory = {theory}," if theory else ""
        text = text.replace(f"{begin}0.0,", f"{begin}{value},{told}")
    return text
