"""Flights by JSBSim, planted sensor errors put on them: truth that shares no code with the
reconstruction.

The light aircraft of JSBSim's own examples is flown with wind over a planet that does not turn and
is all but flat, so that what a flat-earth reconstruction must find is exact. Air data off the CG,
delays and errors are made here, from four times the sampling rate, without any interpolation.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.consistency.sensors.prediction import FlightRecord
from tests.support.jsbsim_flights import FOOT, POUND, simulator

GRAVITY, STEP, FASTER = 9.80665, 0.02, 4
# of JSBSim per logged sample: its rates and velocities are half a step apart, which is a delay
SUBSTEPS = 4
SLUG_FT3 = POUND / FOOT**4  # kg/m3 per slug/ft3
WIND = {"wind_north": 5.0, "wind_east": -7.0}
SETTLING = 8.0  # s, until the wind's onset has died away
LATEST = 60  # samples at the fast rate that a sensor may be late
NOISE = {
    "ax": 0.02, "ay": 0.02, "az": 0.02, "p": 5e-4, "q": 5e-4, "r": 5e-4,
    "V": 0.3, "alpha": 0.003, "beta": 0.003, "phi": 0.002, "theta": 0.002, "psi": 0.003, "qbar": 10.0,
    "velocity_north": 0.1, "velocity_east": 0.1, "velocity_down": 0.1,
}  # fmt: skip
_PLACES = {
    "p": ("velocities/p-rad_sec", 1.0), "q": ("velocities/q-rad_sec", 1.0), "r": ("velocities/r-rad_sec", 1.0),
    "phi": ("attitude/phi-rad", 1.0), "theta": ("attitude/theta-rad", 1.0), "psi": ("attitude/psi-rad", 1.0),
    "u": ("velocities/u-aero-fps", FOOT), "v": ("velocities/v-aero-fps", FOOT), "w": ("velocities/w-aero-fps", FOOT),
    "velocity_north": ("velocities/v-north-fps", FOOT), "velocity_east": ("velocities/v-east-fps", FOOT),
    "velocity_down": ("velocities/v-down-fps", FOOT), "rho": ("atmosphere/rho-slugs_ft3", SLUG_FT3),
    "fx": ("forces/fbx-total-lbs", POUND), "fy": ("forces/fby-total-lbs", POUND), "fz": ("forces/fbz-total-lbs", POUND),
    "mass": ("inertia/mass-slugs", POUND / FOOT),
}  # fmt: skip


def flown(folder: Path, seconds: float = 60.0) -> dict[str, np.ndarray]:
    """Channels at FASTER times the sampling rate: turns to both sides, pitch and rudder doublets,
    trimmed start."""
    radius = 6.378e8
    planet = folder / "planet.xml"
    planet.write_text(
        f'<planet name="flat"><semimajor_axis unit="M">{radius}</semimajor_axis><semiminor_axis'
        f' unit="M">{radius}</semiminor_axis><rotation_rate unit="RAD/SEC">0</rotation_rate><GM'
        f' unit="M3/SEC2">{GRAVITY * radius**2}</GM><J2>0</J2></planet>'
    )
    executive = simulator("c172p", planet)
    executive.set_dt(STEP / FASTER / SUBSTEPS)
    start = {"h-sl-ft": 4000.0, "vc-kts": 95.0, "gamma-deg": 0.0, "psi-true-deg": 20.0}
    for name, value in start.items():
        executive[f"ic/{name}"] = value
    executive.run_ic()
    executive["propulsion/set-running"] = -1
    executive["simulation/do_simple_trim"] = 1
    trim = {name: executive[f"fcs/{name}-cmd-norm"] for name in ("elevator", "aileron", "rudder")}
    pitch = executive["attitude/theta-rad"]
    for axis in ("north", "east"):  # a trim takes the wind away, so it comes after
        executive[f"atmosphere/wind-{axis}-fps"] = WIND[f"wind_{axis}"] / FOOT
    rows = []
    settled = round(SETTLING / STEP) * FASTER
    for number in range(settled + round(seconds / STEP) * FASTER + 2 * LATEST):
        if number >= settled:
            rows.append([executive[place] * scale for place, scale in _PLACES.values()])
        _steer(executive, number * STEP / FASTER, trim, pitch)
        for _ in range(SUBSTEPS):
            executive.run()
    return dict(zip(_PLACES, np.array(rows).T, strict=True))


def _steer(executive: Any, time: float, trim: Mapping[str, float], pitch: float) -> None:
    """Holds bank and pitch near a schedule; doublets on top, softened so that 50 Hz shows them."""
    bank = 0.5 * np.sin(2 * np.pi * time / 30.0)
    tilt = pitch + 0.07 * np.sin(2 * np.pi * time / 9.0) + 0.04 * np.sin(2 * np.pi * time / 2.5)
    slip = 0.25 * np.sin(2 * np.pi * time / 4.0) * (np.sin(2 * np.pi * time / 17.0) > 0)
    phi, theta = executive["attitude/phi-rad"], executive["attitude/theta-rad"]
    p, q = executive["velocities/p-rad_sec"], executive["velocities/q-rad_sec"]
    executive["fcs/aileron-cmd-norm"] = trim["aileron"] + 0.8 * (bank - phi) - 0.15 * p
    executive["fcs/elevator-cmd-norm"] = trim["elevator"] - 1.5 * (tilt - theta) + 0.3 * q
    executive["fcs/rudder-cmd-norm"] = trim["rudder"] + slip


def measured_record(
    flight: Mapping[str, np.ndarray],
    planted: Mapping[str, float],
    rng: np.random.Generator,
    *,
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise: float = 1.0,
    channels: tuple[str, ...] = tuple(NOISE)[6:],
) -> FlightRecord:
    """A record at STEP of what sensors with `planted` errors show; `arm` is what is believed of the
    air-data point. Delays must be multiples of STEP / FASTER."""
    boom = np.array(arm) + [planted.get(f"air_data_{axis}", 0.0) for axis in "xyz"]
    rates = np.stack([flight[name] for name in "pqr"])
    u, v, w = np.stack([flight[name] for name in "uvw"]) + np.cross(rates.T, boom).T
    speed = np.sqrt(u * u + v * v + w * w)
    truth = {
        **flight,
        **{f"a{axis}": flight[f"f{axis}"] / flight["mass"] for axis in "xyz"},
        **{
            "V": speed,
            "alpha": np.arctan2(w, u),
            "beta": np.arcsin(v / speed),
            "qbar": 0.5 * flight["rho"] * speed**2,
        },
    }

    def shown(name: str) -> np.ndarray:
        late = planted.get(f"{name}_delay", 0.0) * FASTER / STEP
        assert abs(late - round(late)) < 1e-9
        assert abs(late) <= LATEST
        values = truth[name][LATEST - round(late) : len(speed) - LATEST - round(late) : FASTER]
        wrong = (1.0 + planted.get(f"{name}_scale", 0.0)) * values + planted.get(
            f"{name}_bias", 0.0
        )
        return np.asarray(wrong + noise * NOISE[name] * rng.standard_normal(len(values)))

    inputs = np.column_stack([shown(name) for name in ("ax", "ay", "az", "p", "q", "r")])
    density = flight["rho"][LATEST : len(speed) - LATEST : FASTER]
    outputs = {name: shown(name) for name in channels}
    return FlightRecord(
        "jsbsim", STEP, inputs, outputs, "jsbsim", arm, density=density, gravity=GRAVITY
    )
