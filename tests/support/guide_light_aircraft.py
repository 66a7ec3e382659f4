"""Flights for the study of a build-up of a light aircraft: JSBSim flies its own c172p, whose coefficients,
propeller and equations of motion share nothing with the product, and instruments log it with noise."""

from pathlib import Path

import numpy as np

from aerodb.support import Array
from tests.support.guide_build_up import write_table
from tests.support.jsbsim_campaign import (
    STEP,
    Aircraft,
    Plan,
    Signal,
    as_logged,
    doublet,
    flown,
    ladder,
    pulses,
    together,
)

#: Calibrated airspeed [kt] and altitude [ft].
START = {"ic/vc-kts": 95.0, "ic/h-sl-ft": 5000.0}
SWEEP = 40.0
#: Deflections, of full travel, that move the aircraft by some degrees.
ELEVATOR, AILERON, RUDDER = 0.14, 0.15, 0.3
#: What a log of flight tests has.
LOGGED = (
    "V", "qbar", "rho", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "altitude",
    "thrust", "delta_elevator", "delta_aileron", "delta_rudder",
)  # fmt: skip
C172P = Aircraft(
    "c172p",
    # (right - left)/2 of surfaces that go 20 deg up and 15 deg down
    {"delta_aileron": ("fcs/left-aileron-pos-rad", -1.0)},
    {},
    ("propulsion/engine/thrust-lbs",),
    (0.0, 0.0, 0.0),
)


def sweep(start: float, size: float, high: float) -> Signal:
    """A sine over `SWEEP` s, from .08 Hz to `high` Hz, slowly first; faded in and out over 2 s."""
    low = 0.08

    def signal(time: float) -> float:
        t = time - start
        if not 0.0 < t < SWEEP:
            return 0.0
        rate = np.log(high / low) / SWEEP
        phase = 2.0 * np.pi * low * (np.exp(rate * t) - 1.0) / rate
        fade = min(t / 2.0, (SWEEP - t) / 2.0, 1.0)
        return float(size * fade * np.sin(phase))

    return signal


def plans() -> list[Plan]:
    """Six flights with sweeps, to be corrected by; two with doublets and 3-2-1-1, to be judged by."""

    def planned(seconds: float, throttle: Signal | None = None, **inputs: Signal) -> Plan:
        return Plan(START, seconds, **inputs)

    return [
        planned(46.0, elevator=sweep(2.0, ELEVATOR, 2.0)),
        planned(46.0, elevator=sweep(2.0, 0.7 * ELEVATOR, 2.5)),
        planned(90.0, aileron=sweep(2.0, AILERON, 1.5), rudder=sweep(46.0, RUDDER, 1.2)),
        planned(90.0, rudder=sweep(2.0, 0.7 * RUDDER, 1.5), aileron=sweep(46.0, 0.7 * AILERON, 2.0)),
        planned(90.0, elevator=sweep(2.0, ELEVATOR, 2.0), rudder=sweep(46.0, RUDDER, 1.5)),
        planned(90.0, aileron=sweep(2.0, AILERON, 2.0), elevator=sweep(46.0, 1.2 * ELEVATOR, 1.8)),
        planned(
            60.0,
            elevator=together(
                ladder(3.0, 0.5, 1.3 * ELEVATOR), doublet(20.0, 0.7, -ELEVATOR),
                ladder(32.0, 0.4, -1.5 * ELEVATOR), doublet(46.0, 0.4, 1.5 * ELEVATOR),
            ),
        ),
        planned(
            60.0,
            rudder=together(
                doublet(3.0, 1.2, RUDDER), doublet(25.0, 1.0, -RUDDER), ladder(44.0, 0.8, RUDDER),
            ),
            aileron=together(
                doublet(14.0, 1.0, AILERON), doublet(36.0, 0.8, -AILERON), pulses((54.0, AILERON), (55.0, 0.0)),
            ),
        ),
    ]  # fmt: skip


def measured(plan: Plan, seed: int) -> dict[str, Array]:
    """What instruments show of a flight, channel -> (n,); the boom adds the components of the airspeed."""
    channels = flown(C172P, plan)
    log = as_logged(channels, "flight", "c172p", np.random.default_rng([172, seed]))
    shown = {name: log[f"{name}_imu" if f"{name}_imu" in channels else name] for name in LOGGED}
    alpha, beta, speed = shown["alpha"], shown["beta"], shown["V"]
    return {
        "time": STEP * np.arange(len(speed)),
        **shown,
        "u": speed * np.cos(alpha) * np.cos(beta),
        "v": speed * np.sin(beta),
        "w": speed * np.sin(alpha) * np.cos(beta),
    }


def write_light_aircraft_flights(folder: Path) -> list[Path]:
    """Flies all `plans` and writes ``flight-1.csv`` and so on into `folder`; returns them."""
    return [
        write_table(folder / f"flight-{k + 1}.csv", measured(plan, k))
        for k, plan in enumerate(plans())
    ]
