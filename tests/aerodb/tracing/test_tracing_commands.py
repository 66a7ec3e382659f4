"""Instruments from commands: a controller that reacts to the noise of the residual, and its
commands."""

from collections.abc import Iterable, Iterator

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.flight import Flight
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.evidence import NUISANCE, Evidence
from aerodb.tracing.evidence.instrumental_variables import with_commanded_rates, with_instruments
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.evidence.shape_misfit import with_shape_terms
from tests.support.tracing_cells import SETTINGS
from tests.support.tracing_flights import FLOOR, Cell, coloured, evidence_in, flown, library

pytestmark = pytest.mark.usefixtures("phoenix_flights")

NOTHING = Cell("nothing")
FLIGHTS = 6


def _asked(generator: np.random.Generator, n: int, step: float) -> np.ndarray:
    """3-2-1-1s at random times and of random length."""
    command = np.zeros(n)
    for start in np.arange(4.0, n * step - 12.0, 12.0) + generator.uniform(0.0, 3.0):
        unit = generator.uniform(0.5, 1.1)
        edges = start + unit * np.cumsum([0.0, 3.0, 2.0, 1.0, 1.0])
        for k in range(4):
            command[int(edges[k] / step) : int(edges[k + 1] / step)] = (-1.0) ** k
    return command


def _followed(command: np.ndarray, step: float) -> np.ndarray:
    """The rate that a well-damped short period makes of a command: not one of the filters."""
    w, z = 3.0 * step, 0.6
    return np.asarray(lfilter([w * w], [1.0, -2.0 + 2 * z * w, 1.0 - 2 * z * w + w * w], command))


def _flight(
    number: int, generator: np.random.Generator, gain: float, planted: float
) -> tuple[Flight, Evidence]:
    """A flight whose pitch rate follows a command and answers Cm's noise, on which the database
    lacks `planted` of Cm q_hat."""
    flight = flown()[number]
    n, noise = len(flight.time), {axis: coloured(generator, len(flight.time)) for axis in FLOOR}
    command = _asked(generator, n, flight.step)
    rate = flight["q"].std() * _followed(command, flight.step) * 2.0
    flight = flight.with_channels(
        {"q": rate + gain * rate.std() * noise["Cm"], "command_pitch": command}
    )
    seen = evidence_in(NOTHING, flight, library(), 0)
    # No alpha goes with this rate: what the two differ by would look like rotating air.
    columns = {
        name: column for name, column in seen.columns.items() if not name.startswith(NUISANCE)
    }
    residual = {axis: FLOOR[axis] * values for axis, values in noise.items()}
    if planted:
        residual["Cm"] = residual["Cm"] + planted * seen.columns["pitch_damping@Cm"]["Cm"]
    return flight, with_shape_terms(
        Evidence(seen.flight, seen.step, residual, seen.usable, columns), flight, library()
    )


def _instrumented(flight: Flight, evidence: Evidence) -> Evidence:
    commanded = with_commanded_rates(flight, SETTINGS.bandwidth)
    assert commanded is not None
    return with_instruments(
        evidence,
        with_shape_terms(evidence_in(NOTHING, commanded, library(), 0), commanded, library()),
    )


def _flights(number: int, gain: float, planted: float = 0.0) -> Iterator[tuple[Flight, Evidence]]:
    """The flights of a campaign."""
    generator = np.random.default_rng([77, number])
    for place in generator.choice(len(flown()), FLIGHTS, replace=False):
        yield _flight(int(place), generator, gain, planted)


def _claimed(evidence: Iterable[Evidence]) -> set[str]:
    """What a campaign of these flights claims of the aerodynamics."""
    normal_equations = [normal_equations_of(each, SETTINGS) for each in evidence]
    traced = trace(normal_equations, library(), SETTINGS)
    return {f.hypothesis for f in traced.findings if f.verdict in ("confirmed", "alias_group")}


@pytest.mark.campaign
def test_what_a_controller_answers_is_no_effect() -> None:
    """Nothing is missing: without instruments most campaigns claim an effect, with those of the
    commands none."""
    fooled = helped = 0
    for number in range(8):
        flights = list(_flights(number, 1.0))
        fooled += bool(_claimed(evidence for _, evidence in flights))
        helped += bool(_claimed(_instrumented(*flight) for flight in flights))
    assert fooled >= 4
    assert helped == 0


def test_a_missing_damping_is_still_found_and_named() -> None:
    found = [
        _claimed(_instrumented(*flight) for flight in _flights(number, 0.3, planted=-4.0))
        for number in range(3)
    ]
    assert all("pitch_damping@Cm" in each for each in found), found


def test_without_commands_that_move_there_are_no_instruments() -> None:
    flight, _ = _flight(0, np.random.default_rng(1), 0.0, 0.0)
    assert (
        with_commanded_rates(
            flight.with_channels({"command_pitch": np.full(len(flight.time), 0.2)}),
            SETTINGS.bandwidth,
        )
        is None
    )


def test_only_what_depends_on_rates_gets_instruments_and_those_follow_the_command() -> None:
    flight, evidence = _flight(0, np.random.default_rng(1), 0.5, 0.0)
    made = _instrumented(flight, evidence).instruments
    assert {"pitch_damping@Cm", "gyro_scale@all:q"} <= made.keys()
    assert not any(name.startswith(("alpha_slope", "roll_damping")) for name in made)
    column, instrument = evidence.columns["pitch_damping@Cm"]["Cm"], made["pitch_damping@Cm"]["Cm"]
    asked = _followed(flight["command_pitch"], flight.step)
    assert abs(np.corrcoef(instrument, asked)[0, 1]) > 0.95 > abs(np.corrcoef(column, asked)[0, 1])


@pytest.mark.parametrize("command", ["command_pitch", "command_roll", "command_yaw"])
def test_commands_are_channels_of_the_glossary(command: str) -> None:
    from aerodb.nomenclature import channel

    assert channel(command).unit == "1"
