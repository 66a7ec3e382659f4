"""Cm_q and Cm_alphadot apart, on an aircraft of another program in which both are known: JSBSim's T-38 (-18 and -9)."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.estimation import Fit, regression
from aerodb.exchange import import_jsbsim
from aerodb.tables import AeroDatabase, transfer_moments
from tests.support.equations import coloured, equation

pytest.importorskip("jsbsim")

from tests.support.jsbsim_flights import (
    aircraft_file,
    centre_of_gravity,
    channels_of,
    own_coefficients,
    simulator,
)

TRUTH = {"q_hat": -18.0, "alphadot_hat": -9.0}
#: Terms of the file that hold them, and its step [s]; every second is a sample.
TERMS, STEP = ("Cmq", "Cmadot"), 0.01
#: Noise of the pitching moment over its standard deviation.
NOISE = 0.01


@pytest.fixture(scope="module")
def lacking() -> AeroDatabase:
    """The T-38 without its two terms."""
    whole = import_jsbsim(aircraft_file("T38"), name="T38")
    left = tuple(term for term in whole.terms if not term.name.endswith(TERMS))
    assert len(left) == len(whole.terms) - len(TERMS), [term.name for term in whole.terms]
    return replace(whole, terms=left)


def _flown(
    lacking: AeroDatabase, frequencies: tuple[float, ...], seconds: float
) -> dict[str, np.ndarray]:
    """Columns, and the pitching moment that the terms that are left do not have, of elevator sines [Hz] in JSBSim."""
    executive = simulator("T38")
    for name, value in {
        "ic/h-sl-ft": 15000.0,
        "ic/vc-kts": 300.0,
        "gear/gear-cmd-norm": 0.0,
        "gear/gear-pos-norm": 0.0,
    }.items():
        executive[name] = value
    executive.set_dt(STEP)
    executive.run_ic()
    executive["propulsion/set-running"] = -1
    for number in range(2):
        executive[f"fcs/throttle-cmd-norm[{number}]"] = 0.6
    executive["simulation/do_simple_trim"] = 1
    level = executive["fcs/elevator-cmd-norm"]
    rows, theirs, cg = [], [], []
    for k in range(round(seconds / STEP)):
        moved = sum(np.sin(2.0 * np.pi * f * STEP * k + n) for n, f in enumerate(frequencies))
        executive["fcs/elevator-cmd-norm"] = level + 0.06 * moved
        executive["fcs/aileron-cmd-norm"] = -0.3 * executive["attitude/phi-rad"]
        executive.run()
        row = channels_of(executive, lacking) | {
            "alphadot": executive["aero/alphadot-rad_sec"], "q": executive["velocities/q-aero-rad_sec"],
            "V": executive["velocities/vt-fps"] * 0.3048, "alpha": executive["aero/alpha-rad"],
        }  # fmt: skip
        rows.append(row)
        theirs.append(own_coefficients(executive))
        cg.append(centre_of_gravity(executive))
    channels = {name: np.array([row[name] for row in rows])[::2] for name in rows[0]}
    made = lacking.predict(channels).coefficients
    made = transfer_moments(
        made, lacking.reference.moment_reference, np.array(cg)[::2], lacking.reference
    )
    half = lacking.reference.chord / (2.0 * channels["V"])
    return {
        "1": np.ones(len(half)), "alpha": channels["alpha"], "q_hat": channels["q"] * half,
        "alphadot_hat": channels["alphadot"] * half, "left": np.array(theirs)[::2, 4] - made["Cm"],
    }  # fmt: skip


def _fit(flown: dict[str, np.ndarray], seed: int) -> Fit:
    columns = {name: values for name, values in flown.items() if name != "left"}
    noise = coloured(np.random.default_rng(seed), len(flown["left"]), 0.9)
    return regression(equation([columns], [flown["left"] + NOISE * flown["left"].std() * noise]))


def test_an_elevator_that_moves_slowly_and_fast_tells_them_apart(lacking: AeroDatabase) -> None:
    """Pitch rate and alphadot differ by the turning of the path: at .1 Hz much, at .9 Hz little. Of 40 draws of the noise
    each is right in the mean, and its intervals hold the truth."""
    flown = _flown(lacking, (0.1, 0.25, 0.5, 0.9), 60.0)
    fits = [_fit(flown, seed) for seed in range(40)]
    for name, true in TRUTH.items():
        off = np.array([fit[name].value - true for fit in fits])
        errors = np.array([fit[name].standard_error for fit in fits])
        assert abs(off.mean()) < 3.0 * off.std() / np.sqrt(len(fits)) < 0.06 * abs(true), name
        assert np.mean(np.abs(off) < 1.96 * errors) >= 0.85, name
    together = [sum(fit[name].value for name in TRUTH) for fit in fits]
    assert together == pytest.approx([sum(TRUTH.values())] * len(fits), rel=0.02)


def test_a_short_doublet_tells_their_sum_alone(lacking: AeroDatabase) -> None:
    """At .9 Hz for 6 s the sum is right within 10 %, and the single ones have standard errors several times as large."""
    flown = _flown(lacking, (0.9,), 6.0)
    fit, long = _fit(flown, 1), _fit(_flown(lacking, (0.1, 0.25, 0.5, 0.9), 60.0), 1)
    assert sum(fit[name].value for name in TRUTH) == pytest.approx(sum(TRUTH.values()), rel=0.1)
    for name in TRUTH:
        assert fit[name].standard_error > 4.0 * long[name].standard_error
