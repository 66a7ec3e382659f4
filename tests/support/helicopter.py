"""A helicopter with a hingeless rotor as a database: flapping and inflow are states with a rate.

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
REFERENCE: Final = """\
[reference]
area = 20.0
chord = 5.1
span = 5.1
pressure = "1000 Pa"
"""

_VARIABLES: Final = {
    "air_u": "V*cos(alpha)*cos(beta)",
    "air_v": "V*sin(beta)",
    "air_w": "V*sin(alpha)*cos(beta)",
    "tip": f"{OMEGA * RADIUS}",
    "hub_u": f"(air_u - q*{HEIGHT})/tip",
    "hub_v": f"(air_v + p*{HEIGHT})/tip",
    "hub_w": "air_w/tip",
    "p_bar": f"p/{OMEGA}",
    "q_bar": f"q/{OMEGA}",
    "lock": f"{LOCK}*rho/1.225",
    # Flapping velocities by azimuth, to the air.
    "flow_c": "X + bs + lc",
    "flow_s": "Y - bc + ls",
    "through": "l0 - hub_w",
    "pitch": f"delta_collective/4 + {TWIST}/5",
    "pitch_edge": f"2*delta_collective/3 + {TWIST}/2",
    # Flap moments of the blades by azimuth, over (rho/2) a c Omega^2 R^4.
    "lift_0": "pitch + (hub_u*delta_longitudinal + hub_v*delta_lateral)/3 - b0d/4 - through/3"
    " - (hub_u*flow_s + hub_v*flow_c)/6",
    "lift_c": "delta_lateral/4 + hub_v*pitch_edge - flow_c/4 - b0*hub_u/3"
    " - hub_v*(b0d/3 + through/2)",
    "lift_s": "delta_longitudinal/4 + hub_u*pitch_edge - flow_s/4 + b0*hub_v/3"
    " - hub_u*(b0d/3 + through/2)",
    "CT": f"{0.5 * SOLIDITY * SLOPE}*(delta_collective/3 + {TWIST}/4"
    " + (hub_u*delta_longitudinal + hub_v*delta_lateral)/2 - b0d/3 - through/2"
    " - (hub_u*flow_s + hub_v*flow_c)/4)",
    "mass_flow": "sqrt(hub_u^2 + hub_v^2 + through^2)",
    "flow_mean": "(hub_u^2 + hub_v^2 + (through + l0)*through)/mass_flow/2",
    "pull": f"rho*{3.141592653589793 * RADIUS**2}*tip^2*CT",
}
_STATES: Final = {
    "b0": ("b0d", 0.05),
    "b0d": (f"lock/2*lift_0 - {FREQUENCY}*b0", 0.0),
    "bc": ("X + q_bar", 0.0),
    "X": (f"lock/2*lift_c - 2*Y - {FREQUENCY - 1.0}*bc", 0.0),
    "bs": ("Y + p_bar", 0.0),
    "Y": (f"lock/2*lift_s + 2*X - {FREQUENCY - 1.0}*bs", 0.0),
    "l0": ("(CT - 2*mass_flow*l0)*75*3.141592653589793/128", 0.05),
    "ls": (
        f"({0.25 * SOLIDITY * SLOPE}*lift_s - flow_mean*(ls + Kp*Y))*45*3.141592653589793/16", 0.0,
    ),
    "lc": (
        f"({0.25 * SOLIDITY * SLOPE}*lift_c - flow_mean*(lc + Kq*X))*45*3.141592653589793/16", 0.0,
    ),
}  # fmt: skip
_TERMS: Final = {
    "FX": "pull*bc - 0.5*rho*{0}*air_u*abs(air_u)",
    "FY": "-pull*bs + {tail}*delta_pedal - 0.5*rho*{1}*air_v*abs(air_v)",
    "FZ": "-pull - 0.5*rho*{2}*air_w*abs(air_w)",
    "MX": "-{spring}*bs - {h}*pull*bs + {th}*{tail}*delta_pedal",
    "MY": "-{spring}*bc - {h}*pull*bc",
    "MZ": "-{arm}*{tail}*delta_pedal + pull*{r}*(l0 + 0.01) - 3000*r",
}


def database(kp: float, kq: float, theory: str = "") -> str:
    """Native TOML, with these wake distortion parameters, and what theory has for them."""
    told = f", theory = {theory}" if theory else ""
    known = f"""\
[parameters]
Kp = {{ value = {kp}, bounds = [-2.0, 6.0], description = "wake distortion in roll"{told} }}
Kq = {{ value = {kq}, bounds = [-2.0, 6.0], description = "wake distortion in pitch"{told} }}
"""
    variables = "".join(
        f'{name} = {{ expression = "{text}" }}\n' for name, text in _VARIABLES.items()
    )
    states = "".join(
        f'[states.{name}]\nrate = "{OMEGA}*({rate})"\ninitial = {initial}\n'
        for name, (rate, initial) in _STATES.items()
    )
    terms = "".join(
        f'[[terms]]\nname = "rotor_{axis}"\naxis = "{axis}"\nexpression = "'
        + text.format(
            *FUSELAGE, tail=TAIL, spring=BLADES / 2 * SPRING, h=HEIGHT, th=TAIL_HEIGHT,
            arm=TAIL_ARM, r=RADIUS,
        )
        + '"\n'
        for axis, text in _TERMS.items()
    )  # fmt: skip
    head = f'name = "helicopter"\n{REFERENCE}moment_reference = [0.0, 0.0, 0.0]\n'
    return f"{head}{known}[variables]\n{variables}{states}{terms}"


VEHICLE: Final = f"""\
name = "helicopter"
{REFERENCE}[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = {MASS}
cg = [0.0, 0.0, 0.0]
Ixx = {INERTIA["Ixx"]}
Iyy = {INERTIA["Iyy"]}
Izz = {INERTIA["Izz"]}
Ixz = {INERTIA["Ixz"]}
[rotors.main]
log = {{ topic = "table", field = "delta_collective" }}
range = [0.0, 0.3]
""" + "".join(
    f'[surfaces.{name}]\nlimits = ["-35 deg", "35 deg"]\n'
    f'log = {{ topic = "table", field = "delta_{name}", unit = "rad" }}\n'
    for name in ("collective", "lateral", "longitudinal", "pedal")
)
