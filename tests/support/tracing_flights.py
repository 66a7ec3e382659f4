"""Campaigns of Phoenix-like flights for tracing: flown closed loop by the example's simulator, with
the real effect library.

A bank of flights is flown once on the preflight database. A campaign draws some of them, adds an
effect on the true state, gives its instruments an error, recomputes everything through the chain
from sensors to coefficients, and adds a coloured residual as buffet and unmodelled flow leave it.
What is drawn anew per campaign is the flights and the noise.
"""

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import hypotheses_for
from aerodb.examples.phoenix import read_example
from aerodb.examples.phoenix.mission import simulate
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.simulation.sensors import at_instruments
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.tracing.evidence.flight_evidence import evidence_of
from aerodb.tracing.evidence.low_pass import BandLimitedFlight, Records, band_limited, in_band
from aerodb.tracing.evidence.normal_equations import FlightNormalEquations, normal_equations_of_band
from aerodb.tracing.evidence.shape_misfit import with_shape_terms
from aerodb.tracing.evidence.thinning import thinned
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import Vehicle, parse_vehicle

DEGREE = np.pi / 180.0
#: Every fourth sample of the simulator's 100 Hz.
STRIDE = 4
STEP = 0.04
#: Residual of the true model (one sigma) and its time constant [s]: buffet and unsteady flow.
FLOOR: Mapping[str, float] = {
    "CX": 0.0015,
    "CY": 0.002,
    "CZ": 0.005,
    "Cl": 0.0004,
    "Cm": 0.0004,
    "Cn": 0.0004,
}
LAG = 0.8
#: What the simulator knows and instruments of the campaign show. alpha, beta and V are those at the
#: CG.
CHANNELS = (
    *(
        "V",
        "alpha",
        "beta",
        "p",
        "q",
        "r",
        "pdot",
        "qdot",
        "rdot",
        "rho",
        "qbar",
        "mach",
        "altitude",
        "height_above_ground",
    ),
    *("ax_imu", "ay_imu", "az_imu", "phi", "theta", "psi"),
)


@lru_cache(maxsize=1)
def vehicle() -> Vehicle:
    """The example's vehicle."""
    return parse_vehicle(read_example("vehicle.toml"), "vehicle.toml")


@lru_cache(maxsize=1)
def preflight() -> AeroDatabase:
    """The example's preflight database: what flies, but for the planted effect."""
    return read_native(read_example("preflight.toml"), "preflight.toml")


#: Flights of the bank: simulated together, so that many cost little more than few.
BANK = 40
FINE = 12


#: The bank at 25 Hz, and its first flights at 100 Hz.
_Flown = tuple[tuple[Flight, ...], tuple[Flight, ...]]
_FILE = "phoenix-flights.pickle"
_read_from: list[Path] = []


def write_bank(folder: Path) -> None:
    """Fly the bank and write it into `folder`, from which other processes can read it."""
    (folder / _FILE).write_bytes(pickle.dumps(_simulated(), pickle.HIGHEST_PROTOCOL))


def read_bank(folder: Path) -> None:
    """From now on this process has the bank that `write_bank` wrote into `folder`."""
    _read_from.append(folder / _FILE)


def flown() -> tuple[Flight, ...]:
    """The bank: flights as perfect instruments show them, at 25 Hz."""
    return _flown()[0]


def flown_finely() -> tuple[Flight, ...]:
    """The first of them at the simulator's 100 Hz: rates can then be differentiated as in the
    product's chain."""
    return _flown()[1]


@lru_cache(maxsize=1)
def _flown() -> _Flown:
    if not _read_from:
        return _simulated()
    found: _Flown = pickle.loads(_read_from[0].read_bytes())
    return found


def _simulated() -> _Flown:
    history = simulate(vehicle(), preflight(), preflight(), 11, BANK)
    channels = at_instruments(history.channels, vehicle())
    names = [name for name in channels if name in CHANNELS or name.startswith("delta_")]

    def flight(number: int, stride: int) -> Flight:
        part = slice(0, int(history.samples[number]), stride)
        own = {name: np.ascontiguousarray(channels[name][part, number]) for name in names}
        return Flight(f"phoenix-{number:02d}", "phoenix", history.time[part], own)

    return tuple(flight(n, STRIDE) for n in range(BANK)), tuple(flight(n, 1) for n in range(FINE))


#: What reconstruction leaves uncertain (one sigma, SI): of the size of the errors that the cells
#: plant.
PRIORS: Mapping[str, float] = {
    **{
        "qbar_scale": 0.03,
        "alpha_bias": 0.3 * DEGREE,
        "alpha_scale": 0.03,
        "beta_bias": 0.3 * DEGREE,
        "mass_share": 0.015,
    },
    **{f"a{axis}_bias": 0.1 for axis in "xyz"},
    **{f"cg_{axis}_offset": 0.015 for axis in "xyz"},
}


@lru_cache(maxsize=4)
def library(overconfident: float = 1.0) -> tuple[Hypothesis, ...]:
    """The library for these flights; every prior sigma divided by `overconfident`."""
    found = hypotheses_for(preflight(), vehicle(), flown_channels(), priors=PRIORS)
    if overconfident == 1.0:
        return found
    return tuple(
        h if h.prior_sigma is None else replace(h, prior_sigma=h.prior_sigma / overconfident)
        for h in found
    )


def flown_channels() -> tuple[str, ...]:
    """Channels of the flights, without flying them."""
    surfaces = (*vehicle().surfaces, *vehicle().combinations)
    return (*CHANNELS, *(f"delta_{name}" for name in surfaces))


#: Changes the instruments of a flight; with the generator, for noise.
Instruments = Callable[[Flight, np.random.Generator], Flight]


@dataclass(frozen=True)
class Cell:
    """What is wrong in a campaign. effects : hypothesis id -> value, on the true state. instruments
    : sensor error. assumed : the vehicle as the analyst has it. reshaped : changes the flight
    itself (coupled surfaces). noisy : adds the state noise once more, for SIMEX."""

    name: str
    effects: Mapping[str, float] = field(default_factory=dict)
    instruments: Instruments | None = None
    assumed: Vehicle | None = None
    reshaped: Callable[[Flight], Flight] | None = None
    noisy: Instruments | None = None


class Bank:
    """The flights of a cell without their residual noise, in the tracing band, made once and drawn
    from."""

    def __init__(
        self,
        cell: Cell,
        flights: Sequence[Flight],
        hypotheses: Sequence[Hypothesis],
        settings: TracingSettings,
    ) -> None:
        self.cell, self.flights, self.hypotheses, self.settings = (
            cell,
            flights,
            hypotheses,
            settings,
        )
        self._made: dict[int, BandLimitedFlight] = {}

    def band(self, number: int) -> BandLimitedFlight:
        """One flight, noise-free."""
        if number not in self._made:
            self.keep(number, evidence_in(self.cell, self.flights[number], self.hypotheses, number))
        return self._made[number]

    def keep(self, number: int, evidence: Evidence) -> None:
        """Takes this evidence for one of the flights."""
        self._made[number] = in_band(evidence, self.settings)

    def draw(
        self, count: int, generator: np.random.Generator, planted: Mapping[str, float] | None = None
    ) -> list[FlightNormalEquations]:
        """Normal equations of `count` different flights with a fresh residual each, and `planted`
        columns of the library besides."""
        chosen = generator.choice(len(self.flights), count, replace=False)
        return [self._normal_equations(int(number), generator, planted or {}) for number in chosen]

    def _normal_equations(
        self, number: int, generator: np.random.Generator, planted: Mapping[str, float]
    ) -> FlightNormalEquations:
        band, n = self.band(number), len(self.flights[number].time)
        every = np.ones(n, dtype=bool)
        index = [band.names.index(name) + 1 for name in planted]
        added = {}
        for axis, (record,) in band.records.items():
            noise = FLOOR[axis] * (coloured(generator, n) + generator.standard_normal())
            limited = band_limited([noise], every, STEP, self.settings.bandwidth)[:, 0]
            added[axis] = limited + record[:, index] @ np.array(list(planted.values()))

        def with_added(records: Records) -> dict[str, list[Array]]:
            result = {
                axis: [np.array(record) for record in parts] for axis, parts in records.items()
            }
            for axis, (record,) in result.items():
                record[:, -1] += added[axis]
            return result

        noisy = tuple(with_added(records) for records in band.noisy)
        return normal_equations_of_band(
            replace(band, records=with_added(band.records), noisy=noisy), self.settings
        )


def coloured(generator: np.random.Generator, n: int, lag: float = LAG, step: float = STEP) -> Array:
    """First-order coloured noise (n,) of unit spread, stationary from the first sample."""
    keep = np.exp(-step / lag)
    drive = np.sqrt(1.0 - keep**2) * generator.standard_normal(n)
    drive[0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive))


def evidence_in(
    cell: Cell, flight: Flight, hypotheses: Sequence[Hypothesis], number: int
) -> Evidence:
    """Evidence of one flight of a cell without residual noise; `number` seeds its instruments'
    noise."""
    flight = cell.reshaped(flight) if cell.reshaped else flight
    planted = planted_columns(flight, cell.effects, hypotheses)
    generator = np.random.default_rng([number, 5])
    read = cell.instruments(flight, generator) if cell.instruments else flight
    noisy = (
        _seen(cell, flight, cell.noisy(read, generator), hypotheses, planted)
        if cell.noisy
        else None
    )
    return _seen(cell, flight, read, hypotheses, planted, (noisy,) if noisy else ())


def _seen(
    cell: Cell,
    true: Flight,
    read: Flight,
    hypotheses: Sequence[Hypothesis],
    planted: Mapping[str, Array],
    noisy: tuple[Evidence, ...] = (),
) -> Evidence:
    """Evidence of the flight as its instruments read it, with the planted effect in what they
    measured."""
    assumed = cell.assumed or vehicle()
    measured = total_coefficients(read, assumed, angular_acceleration="logged")
    shift = _reshaping(cell, true)
    values = {
        axis: measured.values[axis] + planted[axis] * true["qbar"] / read["qbar"] + shift[axis]
        for axis in measured.values
    }
    comparison = compare(read, replace(measured, values=values), preflight(), assumed.reference)
    evidence = replace(
        evidence_of(
            view_of(read, comparison, preflight(), assumed), hypotheses, rotating_air=False
        ),
        noisy=noisy,
    )
    return with_shape_terms(evidence, read, hypotheses)


def _reshaping(cell: Cell, flight: Flight) -> Mapping[str, Array]:
    """What the vehicle's own database changes when a flight's surfaces have been reshaped after it
    was flown."""
    if cell.reshaped is None:
        return dict.fromkeys(AXES, np.zeros(len(flight.time)))
    original = next(other for other in flown() if other.id == flight.id)
    now, then = (preflight().predict(f.channels).coefficients for f in (flight, original))
    return {axis: now[axis] - then[axis] for axis in AXES}


#: White noise of the vehicle's sensors, one sigma, SI (vehicle.toml).
SENSOR_NOISE: Mapping[str, float] = {
    **dict.fromkeys(("p", "q", "r"), 0.0006),
    **dict.fromkeys(("ax_imu", "ay_imu", "az_imu"), 0.02),
    **{"V": 0.12, "alpha": 0.001, "beta": 0.001},
}


def through_the_chain(
    flight: Flight,
    generator: np.random.Generator,
    hypotheses: Sequence[Hypothesis],
    effects: Mapping[str, float],
    bandwidth: float,
) -> Evidence:
    """Evidence of noisy sensors' readings at 100 Hz: rates differentiated, forces moved to the CG;
    no made-up residual.

    Thinned to `bandwidth` [Hz], as the product does with what it takes to be long.
    """
    noise = {
        name: sigma * generator.standard_normal(len(flight.time))
        for name, sigma in SENSOR_NOISE.items()
    }
    read = flight.with_channels({name: flight[name] + values for name, values in noise.items()})
    measured = total_coefficients(read, vehicle())
    planted = planted_columns(flight, effects, hypotheses)
    measured = replace(
        measured, values={axis: values + planted[axis] for axis, values in measured.values.items()}
    )
    read, comparison = thinned(
        read, compare(read, measured, preflight(), vehicle().reference), bandwidth
    )
    return with_shape_terms(
        evidence_of(
            view_of(read, comparison, preflight(), vehicle()), hypotheses, rotating_air=False
        ),
        read,
        hypotheses,
    )


def planted_columns(
    flight: Flight, effects: Mapping[str, float], hypotheses: Sequence[Hypothesis]
) -> dict[str, Array]:
    """The planted effects (n,) per axis, on the true state; aerodynamic ones only."""
    total = {axis: np.zeros(len(flight.time)) for axis in AXES}
    if effects:
        comparison = compare(
            flight,
            total_coefficients(flight, vehicle(), angular_acceleration="logged"),
            preflight(),
            vehicle().reference,
        )
        view = view_of(flight, comparison, preflight(), vehicle())
        by_id = {h.id: h for h in hypotheses}
        for name, value in effects.items():
            for axis, column in by_id[name].columns(view).items():
                total[axis] = total[axis] + value * column
    return total


def phoenix_size(name: str, bank: Bank, times: float = 3.0) -> float:
    """The value at which the effect's rms about its mean is `times` the noise floor on its
    strongest axis (docs/reference/conventions.md).

    A constant has no rms about its mean: its own size counts.
    """
    if name.startswith("zero_offset"):
        return times * FLOOR[name.split("@")[1]]
    ratio = []
    for number in range(min(8, len(bank.flights))):
        band = bank.band(number)
        spread = [
            float(record[:, band.names.index(name) + 1].std()) / FLOOR[axis]
            for axis, (record,) in band.records.items()
        ]
        ratio.append(max(spread))
    return times / float(np.mean(ratio))
