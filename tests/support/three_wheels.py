"""A vehicle of 1198 kg on three wheels: as parts, and as JSBSim's with its own gear."""

import tempfile
from pathlib import Path
from typing import Final

import numpy as np

NOSE: Final = (2.4, 0.0, 1.2)
MAIN: Final = (-0.4, 0.9, 1.2)
SPRING, DAMPING = 60e3, 6e3  # N/m, N s/m
MASSES: Final = {"mass": 1198.0, "Ixx": 400.0, "Iyy": 2500.0, "Izz": 2700.0}
ROLLING: Final = 0.043
_FOOT: Final = 0.3048

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

_CONTACT: Final = """<contact type="BOGEY" name="{name}">
<location unit="M"><x>{x}</x><y>{y}</y><z>{z}</z></location>
<static_friction>0.8</static_friction><dynamic_friction>0.5</dynamic_friction>
<rolling_friction>0.043</rolling_friction>
<spring_coeff unit="N/M">{spring}</spring_coeff><damping_coeff unit="N/M/SEC">{damping}</damping_coeff>
<max_steer unit="DEG">0</max_steer><brake_group>NONE</brake_group><retractable>0</retractable>
</contact>"""


def _file() -> str:
    legs = (("nose", NOSE), ("right", MAIN), ("left", (MAIN[0], -MAIN[1], MAIN[2])))
    contacts = "".join(
        _CONTACT.format(name=name, x=-x, y=y, z=-z, spring=SPRING, damping=DAMPING)
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
</mass_balance><ground_reactions>{contacts}</ground_reactions><aerodynamics/></fdm_config>"""


def stopped_in_jsbsim(mu_brake: float, speed: float, height: float) -> tuple[float, float]:
    """Time [s] and distance [m] to standstill with the main wheels' friction of eq. 8.

    speed : at the start [m/s], level at `height` [m] above ground.
    """
    import jsbsim

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "aircraft/wheels/wheels.xml"
        path.parent.mkdir(parents=True)
        path.write_text(_file(), encoding="utf-8")
        program = jsbsim.FGFDMExec(folder)
        program.set_debug_level(0)
        program.load_model("wheels")
        program.set_dt(0.002)
        program["ic/lat-geod-deg"] = 45.54  # gravity is 9.80665 m/s2
        program["ic/terrain-elevation-ft"] = 0.0
        program["ic/h-agl-ft"] = height / _FOOT
        program["ic/u-fps"] = speed / _FOOT
        program.run_ic()
        distance = 0.0
        while program["simulation/sim-time-sec"] < 100.0:
            u = program["velocities/u-fps"] * _FOOT
            if u < 1e-3:
                return float(program["simulation/sim-time-sec"]), distance
            for unit in (1, 2):
                friction = mu_brake * (0.74712 - 0.00144 * u) + ROLLING
                program[f"gear/unit[{unit}]/rolling_friction_coeff"] = friction
            program.run()
            distance += (
                np.hypot(program["velocities/v-north-fps"], program["velocities/v-east-fps"])
                * _FOOT
                * 0.002
            )
    raise AssertionError("JSBSim's vehicle does not stand still")
