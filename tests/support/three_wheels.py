"""A vehicle of 1198 kg on three wheels: as parts, and as JSBSim's with its own gear."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

NOSE: Final = (2.4, 0.0, 1.2)
MAIN: Final = (-0.4, 0.9, 1.2)
SPRING, DAMPING = 60e3, 6e3  # N/m, N s/m
MASSES: Final = {"mass": 1198.0, "Ixx": 400.0, "Iyy": 2500.0, "Izz": 2700.0}
ROLLING: Final = 0.043
_FOOT: Final = 0.3048
#: Largest angle of JSBSim's nose wheel [deg], and its step [s].
_STEER: Final = 10.0
_STEP: Final = 0.002

#: Native TOML. Its pressure is a number that scales coefficients only.
THREE_WHEELS: Final = f"""\
name = "three wheels"
[reference]
area = 10.3
chord = 3.0
span = 3.8
pressure = 100.0
moment_reference = [0.0, 0.0, 0.0]
[free_inputs]
brake = "1"
steering = "rad"
[parameters]
mu_brake = {{ value = 0.22, bounds = [0.0, 1.0] }}
mu_roll = {{ value = {ROLLING}, bounds = [0.0, 0.2] }}
mu_side = {{ value = 4.2972, bounds = [0.0, 20.0] }}
[parts.nose]
kind = "leg"
position = {list(NOSE)}
spring = {SPRING}
damping = {DAMPING}
along = "mu_roll"
cornering = "mu_side"
side_limit = 0.6
steering = "steering"
[parts.main]
kind = "leg"
mirror = true
position = {list(MAIN)}
spring = {SPRING}
damping = {DAMPING}
along = "brake*mu_brake*(0.74712 - 0.00144*u) + mu_roll"
cornering = "mu_side"
side_limit = "0.6 - 0.2*brake"
"""

#: The same with aerodynamics, and its vehicle file.
WITH_AIR: Final = (
    THREE_WHEELS.replace("pressure = 100.0\n", "")
    + """
[derivatives.CX]
1 = -0.06
[derivatives.CY]
beta = -0.5
[derivatives.CZ]
1 = -0.2
[derivatives.Cn]
beta = 0.05
"""
)
#: The same with the largest side force of JSBSim's main wheels, which no brake lessens: what is true of
#: its rolls also before the brakes.
AS_IN_JSBSIM: Final = WITH_AIR.replace('"0.6 - 0.2*brake"', "0.4")
VEHICLE: Final = """\
name = "wheels"
[reference]
area = 10.3
chord = 3.0
span = 3.8
[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = 1198.0
cg = [0.0, 0.0, 0.0]
Ixx = 400.0
Iyy = 2500.0
Izz = 2700.0
Ixz = 0.0
"""
#: Slope of the side force [1/rad], and its largest coefficients (nose, main wheels with brakes).
SIDE, LARGEST = 4.2972, (0.6, 0.4)
#: Latitude of a runway at which gravity is 9.80665 m/s2 [deg].
LATITUDE: Final = 45.54

_CONTACT: Final = """<contact type="BOGEY" name="{name}">
<location unit="M"><x>{x}</x><y>{y}</y><z>{z}</z></location>
<static_friction>0.8</static_friction><dynamic_friction>0.5</dynamic_friction>
<rolling_friction>0.043</rolling_friction>
<spring_coeff unit="N/M">{spring}</spring_coeff><damping_coeff unit="N/M/SEC">{damping}</damping_coeff>
<max_steer unit="DEG">{steer}</max_steer><brake_group>NONE</brake_group><retractable>0</retractable>
{cornering}</contact>"""


def _cornering(largest: float) -> str:
    """Eqs. 9 to 11 as JSBSim's table over the slip angle [deg]."""
    half = 40.0 * np.linspace(0.0, 1.0, 81) ** 2
    slip = np.concatenate([-half[:0:-1], half])
    phi = np.clip(SIDE * np.deg2rad(slip) / largest, -1.5, 1.5)
    rows = zip(slip, largest * (phi - 4.0 / 27.0 * phi**3), strict=True)
    text = "\n".join(f"{angle:.8f} {value:.10f}" for angle, value in rows)
    table = f"<tableData>\n{text}\n</tableData></table>"
    return f'<table name="CORNERING_COEFF" type="internal">{table}'


def _function(axis: str, name: str, value: float, *factors: str) -> str:
    product = "".join(f"<property>{each}</property>" for each in ("aero/qbar-area", *factors))
    inside = f"<product>{product}<value>{value}</value></product>"
    return f'<axis name="{axis}"><function name="aero/{name}">{inside}</function></axis>'


_AIR: Final = "".join(
    (
        _function("X", "cx", -0.06),
        _function("Y", "cy", -0.5, "aero/beta-rad"),
        _function("Z", "cz", -0.2),
        _function("YAW", "cn", 0.05, "aero/beta-rad", "metrics/bw-ft"),
    )
)


def _file(air: bool = False) -> str:
    legs = (("nose", NOSE), ("right", MAIN), ("left", (MAIN[0], -MAIN[1], MAIN[2])))
    contacts = "".join(
        _CONTACT.format(
            name=name,
            x=-x,
            y=y,
            z=-z,
            spring=SPRING,
            damping=DAMPING,
            steer=_STEER if air and name == "nose" else 0,
            cornering=_cornering(LARGEST[name != "nose"]) if air else "",
        )
        for name, (x, y, z) in legs
    )
    moments = "".join(
        f'<{name.lower()} unit="KG*M2">{MASSES[name]}</{name.lower()}>'
        for name in ("Ixx", "Iyy", "Izz")
    )
    point = "<x>0</x><y>0</y><z>0</z></location>"
    return f"""<?xml version="1.0"?>
<fdm_config name="wheels" version="2.0" release="ALPHA"><fileheader/>
<metrics><wingarea unit="M2">10.3</wingarea><wingspan unit="M">3.8</wingspan><chord unit="M">3</chord>
<location name="AERORP" unit="M">{point}</metrics>
<mass_balance>{moments}<emptywt unit="KG">{MASSES["mass"]}</emptywt><location name="CG" unit="M">{point}
</mass_balance><ground_reactions>{contacts}</ground_reactions><aerodynamics>{_AIR if air else ""}</aerodynamics>
</fdm_config>"""


@contextmanager
def _loaded(height: float, air: bool = False) -> Iterator[Any]:
    """JSBSim with the vehicle level at `height` [m] above ground, before `run_ic`."""
    import jsbsim

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "aircraft/wheels/wheels.xml"
        path.parent.mkdir(parents=True)
        path.write_text(_file(air), encoding="utf-8")
        program = jsbsim.FGFDMExec(folder)
        program.set_debug_level(0)
        program.load_model("wheels")
        program.set_dt(_STEP)
        program["ic/lat-geod-deg"] = LATITUDE
        program["ic/terrain-elevation-ft"] = 0.0
        program["ic/h-agl-ft"] = height / _FOOT
        yield program


def stopped_in_jsbsim(mu_brake: float, speed: float, height: float) -> tuple[float, float]:
    """Time [s] and distance [m] to standstill with the main wheels' friction of eq. 8.

    speed : at the start [m/s], level at `height` [m] above ground.
    """
    with _loaded(height) as program:
        program["ic/u-fps"] = speed / _FOOT
        program.run_ic()
        distance = 0.0
        while program["simulation/sim-time-sec"] < 100.0:
            u = program["velocities/u-fps"] * _FOOT
            if u < 1e-3:
                return float(program["simulation/sim-time-sec"]), distance
            _rub(program, mu_brake, u)
            program.run()
            distance += (
                np.hypot(program["velocities/v-north-fps"], program["velocities/v-east-fps"])
                * _FOOT
                * _STEP
            )
    raise AssertionError("JSBSim's vehicle does not stand still")


def _rub(program: Any, mu_brake: float, u: float) -> None:
    """Friction of the main wheels by eq. 8."""
    for unit in (1, 2):
        friction = mu_brake * (0.74712 - 0.00144 * u) + ROLLING
        program[f"gear/unit[{unit}]/rolling_friction_coeff"] = friction


_FEET: Final = {
    "velocity_north": "velocities/v-north-fps", "velocity_east": "velocities/v-east-fps",
    "V": "velocities/vt-fps", "height_above_ground": "position/h-agl-ft",
}  # fmt: skip
_RADIANS: Final = {
    "phi": "attitude/phi-rad", "theta": "attitude/theta-rad", "psi": "attitude/psi-rad",
    "p": "velocities/p-rad_sec", "q": "velocities/q-rad_sec", "r": "velocities/r-rad_sec",
    "alpha": "aero/alpha-rad", "beta": "aero/beta-rad",
}  # fmt: skip


def rolled_in_jsbsim(
    mu_brake: float,
    wind: tuple[float, float],
    height: float,
    speed: float = 59.15,
    braking_from: float = 0.0,
) -> dict[str, np.ndarray]:
    """Channels (n,) at 50 Hz [SI] of a roll to a standstill with brakes that are pressed within a
    second from a time [s] on (0: all the time), in a wind north and east [m/s], with a pilot who holds the runway by the nose wheel."""
    rows: dict[str, list[float]] = {}
    with _loaded(height, air=True) as program:
        program["ic/vn-fps"] = speed / _FOOT
        program.run_ic()
        for way, blown in zip(("north", "east"), wind, strict=True):
            program[f"atmosphere/wind-{way}-fps"] = blown / _FOOT
        north = east = steering = 0.0
        for step in range(50_000):
            now = {name: program[key] * _FOOT for name, key in _FEET.items()}
            now |= {name: program[key] for name, key in _RADIANS.items()}
            now["psi"] = float(np.arctan2(np.sin(now["psi"]), np.cos(now["psi"])))
            now |= {"ax": 9.80665 * program["accelerations/Nx"], "north": north, "east": east}
            now |= {"time": program["simulation/sim-time-sec"], "steering": steering}
            pressed = now["time"] - braking_from if braking_from else 1.0
            now["brake"] = float(np.clip(pressed, 0.0, 1.0))
            if step % 10 == 0:
                for name, value in now.items():
                    rows.setdefault(name, []).append(value)
            u = program["velocities/u-fps"] * _FOOT
            if u < 1e-3:
                return {name: np.array(values) for name, values in rows.items()}
            steering = -now["psi"] - 0.3 * now["r"] - 0.003 * east
            steering = float(np.clip(steering, -np.deg2rad(_STEER), np.deg2rad(_STEER)))
            program["fcs/steer-cmd-norm"] = np.rad2deg(steering) / _STEER
            _rub(program, now["brake"] * mu_brake, u)
            program.run()
            north += program["velocities/v-north-fps"] * _FOOT * _STEP
            east += program["velocities/v-east-fps"] * _FOOT * _STEP
    raise AssertionError("JSBSim's vehicle does not stand still")


def measured(channels: dict[str, np.ndarray], seed: int = 0) -> dict[str, np.ndarray]:
    """The channels as a log has them: positions [rad] with 3 m of noise, heading with 0.2 deg,
    airspeed with 0.5 m/s, no velocities over the ground."""
    from aerodb.physics import Earth

    rng = np.random.default_rng(seed)
    noise = {
        "north": 3.0, "east": 3.0, "psi": np.deg2rad(0.2), "theta": np.deg2rad(0.1), "V": 0.5,
        "height_above_ground": 0.1,
    }  # fmt: skip
    found = {
        name: values + noise.get(name, 0.0) * rng.standard_normal(len(values))
        for name, values in channels.items()
        if not name.startswith("velocity")
    }
    latitude = np.deg2rad(LATITUDE)
    to_north, to_east = Earth(latitude).metres_per_radian
    found["latitude"] = latitude + found.pop("north") / to_north
    found["longitude"] = found.pop("east") / to_east
    found["altitude"] = found["height_above_ground"]
    found["brake"] = channels.get("brake", np.ones(len(found["time"])))
    return found
