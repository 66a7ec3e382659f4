"""The same vehicle in JSBSim and in this simulation: open loop, six degrees of freedom.

The reference point is off the CG. JSBSim flies over a rotating ellipsoid; the latitude is chosen
for standard gravity. The remaining difference is the Coriolis acceleration, 2 x 7.3e-5 rad/s x 60
m/s = 0.009 m/s2: in 3 s it turns the flight path by about 3e-4 rad, which sets the tolerances.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from aerodb.physics import quaternion_from_euler
from aerodb.simulation.airframe_model import Airframe, MovingAir
from aerodb.simulation.motion import inertia_matrix
from aerodb.support import Array
from tests.support.runge_kutta import runge_kutta_step

jsbsim = pytest.importorskip("jsbsim")

FOOT = 0.3048
AREA, SPAN, CHORD = 10.0, 6.0, 3.0
ARM = (0.2, 0.0, 0.05)

#: axis -> coefficients of the constant, alpha, beta, p b/2V, q c/2V, r b/2V; every axis coupled on
#: purpose.
DERIVATIVES: dict[str, tuple[float, ...]] = {
    "CX": (-0.04, 0.10, 0.02, 0.0, 0.3, 0.0),
    "CY": (0.01, 0.05, -0.6, 0.1, 0.0, 0.3),
    "CZ": (-0.10, -3.0, 0.05, 0.0, -4.0, 0.0),
    "Cl": (0.001, 0.01, -0.08, -0.45, 0.02, 0.12),
    "Cm": (0.01, -0.25, 0.03, 0.02, -6.0, 0.03),
    "Cn": (-0.002, 0.01, 0.10, -0.03, 0.01, -0.25),
}
_REGRESSORS = (
    *(
        "aero/alpha-rad",
        "aero/beta-rad",
        "velocities/p-aero-rad_sec",
        "velocities/q-aero-rad_sec",
        "velocities/r-aero-rad_sec",
    ),
)
_HATS = ("", "", "aero/bi2vel", "aero/ci2vel", "aero/bi2vel")
_AXES = {
    "X": ("CX", ""),
    "Y": ("CY", ""),
    "Z": ("CZ", ""),
    "ROLL": ("Cl", "bw"),
    "PITCH": ("Cm", "cbarw"),
    "YAW": ("Cn", "bw"),
}


def aerodynamics(channels: Mapping[str, Array]) -> dict[str, Array]:
    half = 0.5 / channels["V"]
    rates = (channels["p"] * SPAN * half, channels["q"] * CHORD * half, channels["r"] * SPAN * half)
    regressors = (1.0, channels["alpha"], channels["beta"], *rates)
    return {
        axis: sum((c * x for c, x in zip(row, regressors, strict=True)), 0 * half)
        for axis, row in DERIVATIVES.items()
    }


def aircraft_xml() -> str:
    axes = []
    for name, (axis, length) in _AXES.items():
        constant, *slopes = DERIVATIVES[axis]
        terms = [f"<value>{constant}</value>"]
        for slope, regressor, hat in zip(slopes, _REGRESSORS, _HATS, strict=True):
            factor = f"<property>{hat}</property>" if hat else ""
            terms.append(
                f"<product><value>{slope}</value><property>{regressor}</property>{factor}</product>"
            )
        arm = f"<property>metrics/{length}-ft</property>" if length else ""
        scale = f"<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>{arm}"
        function = (
            "<function"
            f' name="aero/total/{axis}"><product>{scale}<sum>{"".join(terms)}</sum></product></function>'
        )
        axes.append(f'<axis name="{name}">{function}</axis>')
    # Structural axes: x aft, z up. The reference point lies ARM from the CG in body axes.
    return f"""<?xml version="1.0"?>
<fdm_config name="body" version="2.0" release="ALPHA">
<metrics><wingarea unit="M2">{AREA}</wingarea><wingspan unit="M">{SPAN}</wingspan><chord unit="M">{CHORD}</chord>
<location name="AERORP" unit="M"><x>{-ARM[0]}</x><y>{ARM[1]}</y><z>{-ARM[2]}</z></location></metrics>
<mass_balance negated_crossproduct_inertia="false">
<ixx unit="KG*M2">900</ixx><iyy unit="KG*M2">2500</iyy><izz unit="KG*M2">3100</izz><ixz unit="KG*M2">250</ixz>
<emptywt unit="KG">1000</emptywt><location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/><propulsion/><flight_control name="none"/>
<aerodynamics>{"".join(axes)}</aerodynamics></fdm_config>"""


def flown_by_jsbsim(
    folder: Path, initial: Mapping[str, float], duration: float
) -> dict[str, float]:
    (folder / "aircraft" / "body").mkdir(parents=True)
    (folder / "aircraft" / "body" / "body.xml").write_text(aircraft_xml(), encoding="utf-8")
    simulator = jsbsim.FGFDMExec(str(folder), None)
    simulator.set_debug_level(0)
    assert simulator.load_model("body")
    simulator.set_dt(0.001)
    for name, value in initial.items():
        simulator[f"ic/{name}"] = value
    assert simulator.run_ic()
    for _ in range(round(duration / 0.001)):
        simulator.run()
    names = {
        "V": ("velocities/vt-fps", FOOT),
        "alpha": ("aero/alpha-rad", 1),
        "beta": ("aero/beta-rad", 1),
    }
    names |= {x: (f"velocities/{x}-rad_sec", 1) for x in "pqr"}
    names |= {x: (f"attitude/{x}-rad", 1) for x in ("phi", "theta", "psi")}
    names["altitude"] = ("position/h-sl-ft", FOOT)
    return {name: simulator[place] * scale for name, (place, scale) in names.items()}


def test_three_seconds_of_coupled_flight_agree_with_jsbsim(tmp_path: Path) -> None:
    """Rolling, pitching and yawing with a large product of inertia; a wrong sign of any term is 100
    times the tolerance."""
    phi, theta, psi, altitude = 0.3, -0.1, 1.0, 2000.0
    motion = {"u": 60.0, "v": 2.0, "w": 4.0, "p": 0.3, "q": 0.1, "r": -0.15}
    initial = {f"{x}-fps": motion[x] / FOOT for x in "uvw"} | {
        f"{x}-rad_sec": motion[x] for x in "pqr"
    }
    initial |= {"lat-geod-deg": 45.5, "long-gc-deg": 0.0, "h-sl-ft": altitude / FOOT}
    initial |= {"phi-rad": phi, "theta-rad": theta, "psi-true-rad": psi}
    theirs = flown_by_jsbsim(tmp_path, initial, 3.0)
    inertia = inertia_matrix(900.0, 2500.0, 3100.0, 250.0)
    frame = Airframe(
        1000.0, inertia, AREA, np.array([SPAN, CHORD, SPAN]), np.array(ARM), aerodynamics, {}
    )
    state = np.zeros((13, 1))
    state[:6, 0] = list(motion.values())
    state[6:10] = quaternion_from_euler(np.array([phi]), np.array([theta]), np.array([psi]))
    state[12] = -altitude
    still = MovingAir(np.zeros((3, 1)), np.zeros((3, 1)))

    def rate(_: float, s: Array) -> Array:
        return frame.state_rate(s, still, {})

    for _ in range(300):
        state = runge_kutta_step(rate, 0.0, state, 0.01, rate(0.0, state))
    ours, _ = frame.evaluate(state, still, {})
    tolerance = {"V": 0.01, "altitude": 0.06} | dict.fromkeys("pqr", 1e-3)
    for name, value in theirs.items():
        assert ours[name][0] == pytest.approx(value, abs=tolerance.get(name, 5e-4)), name
