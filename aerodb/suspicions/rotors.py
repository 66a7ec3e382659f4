"""Rotors of a flight against its vehicle's database: one whose thrust is not that of the others, or
a battery with whose voltage all thrust falls.

A weak rotor lessens the lift and turns the vehicle as its own command says. What else may be wrong
is left free on each axis: a constant and a trend (biased sensors, the centre of gravity, mass), a
factor of the whole and its trend (inertia, density, the battery), the force along z (centre of
gravity), and linear effects of flow and rates (drag, inflow, damping). So hover alone tells of no
rotor: with constant commands a weak rotor is a shifted centre of gravity. Where the voltage of the
battery is logged, what goes with it is free as well, and told as the battery's.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import Suspicion
from aerodb.estimation import least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.parts import beyond_tilt
from aerodb.signals import bridge, low_passed
from aerodb.support import Array, half_interval
from aerodb.suspicions.evidence import ERRORS, FEWEST, LIKELIER
from aerodb.suspicions.rotor_order import order_suspicions
from aerodb.tables import AeroDatabase, Number, times

#: Channel of what turns all rotors.
BATTERY: Final = "battery_voltage"
#: Axes on which thrust acts.
_AXES: Final = ("CZ", "Cl", "Cm")
#: Upper edge [Hz] of what is compared: that of the measured moments, and below the lag of motors.
HIGHEST: Final = 4.0
#: Least share of its thrust by which a rotor is said to differ, with all of its interval of 95 %:
#: those of a kind differ by 1 to 2 %. So it is for what the battery takes from all: an
#: accelerometer drifts by less.
LEAST: Final = 0.04
#: Fewest rotors of which one can be told from all.
FEWEST_ROTORS: Final = 3
#: Largest power of the voltage that thrust goes with: that of the square of speed, which goes with
#: the voltage at most.
_SQUARE: Final = 2.0
#: Factor of a thrust of which the slope is taken.
_STEP: Final = 0.01


def rotor_suspicions(
    flight: Flight,
    database: AeroDatabase,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    bandwidth: float | None,
) -> tuple[Suspicion, ...]:
    """Return the rotor whose thrust is not the database's where the others' is, and the battery
    with whose voltage all lose thrust, or what is wrong with the order of all
    (`order_suspicions`); empty for none.

    measured, predicted, usable : axis -> (n,), as `aerodb.coefficients.compare` gives them.
    bandwidth : Hz, of the moments. Share of the thrust without unit.
    """
    tilted = _tilted(flight, database)
    if tilted:
        return tilted
    names = [
        name.removesuffix("_thrust")
        for name, variable in database.variables.items()
        if name.endswith("_thrust") and _kind(database, variable.part) == "rotor"
    ]
    axes = [axis for axis in _AXES if axis in measured]
    needed = ("V", "alpha", "beta", "p", "q", "r")
    if len(names) < FEWEST_ROTORS or len(axes) < len(_AXES):
        return ()
    if any(name not in flight for name in needed):
        return ()
    good = flight.usable([*needed, *(n for n in database.inputs if n in flight)])
    for axis in (*axes, *({"Cn"} & measured.keys())):
        good &= usable[axis] & np.isfinite(measured[axis]) & np.isfinite(predicted[axis])
    if good.sum() < FEWEST:
        return ()
    high = min(bandwidth or HIGHEST, HIGHEST, 0.4 / flight.step)
    every = max(1, int(0.25 / (high * flight.step)))
    known: dict[int, tuple[Array, Array]] = {}  # several checks ask for the same columns

    def banded(values: Array) -> Array:
        if id(values) not in known:
            kept = low_passed(np.where(good, values, np.nan), flight.step, high)
            known[id(values)] = values, np.asarray(kept[::every][good[::every]])
        return known[id(values)][1]

    order = order_suspicions(flight, database, measured, good, banded)
    if order:
        return order
    voltage = _voltage(flight, good)
    anywhere = _anywhere(flight)
    sag = _sag(anywhere, measured["CZ"], predicted["CZ"], voltage, banded)
    effects = _effects(flight, database, names)
    shared = [banded(column) for column in anywhere]
    lengths, left, shares = [], [], {name: list[Array]() for name in names}
    for axis in axes:
        own = _on_axis(flight, axis, measured, predicted)
        if voltage is not None:
            own.append(predicted[axis] * (voltage / np.mean(voltage[good]) - 1.0))
        free = np.column_stack([*shared, *(banded(column) for column in own)])
        response = _beyond(free, banded(measured[axis] - predicted[axis]))
        size = float(np.sqrt(np.mean(response**2))) or 1.0
        lengths.append(len(response))
        left.append(response / size)
        for name in names:
            shares[name].append(_beyond(free, banded(effects[name][axis])) / size)
    together = np.concatenate(left)
    found: dict[str, tuple[float, float]] = {}
    for name in names:
        column = np.concatenate(shares[name])[:, None]
        try:
            fit = least_squares(column, together, (name,), lengths)
        except ValueError:
            return sag  # its command never moves
        found[name] = (float(fit.estimates[0]), float(fit.standard_errors[0]))
    ranked = sorted(found, key=lambda name: abs(found[name][0]) / found[name][1], reverse=True)
    value, error = found[ranked[0]]
    size, next_size = (abs(found[name][0]) / found[name][1] for name in ranked[:2])
    least = abs(value) - half_interval(error)
    if size < ERRORS or least < LEAST or 0.5 * (size**2 - next_size**2) < LIKELIER:
        return sag
    less = "less" if value < 0.0 else "more"
    words = (
        f"the thrust of {ranked[0]} is {abs(value):.0%} {less} than that of the others beside the"
        f" database, +- {half_interval(error):.1%}"
    )
    evidence = {"share": value, "standard_error": error}
    return (Suspicion(ranked[0], "thrust", words, evidence), *sag)


def speed_by_voltage(flight: Flight, found: Sequence[Suspicion]) -> str:
    """Return the factor of the rotors' speed by the voltage of the battery [V], as an expression,
    where what was found of a flight tells that thrust goes with it; empty otherwise.

    Thrust goes with the square of the speed, and the speed of a plain motor with the voltage: an
    exponent stands where the interval of 95 % does not hold that.
    """
    told = [each.evidence for each in found if each.channel == BATTERY and each.kind == "sag"]
    if not told:
        return ""
    voltage = flight[BATTERY][flight.usable([BATTERY]) & (flight[BATTERY] > 0.0)]
    power, share = float(told[0]["power"]), float(told[0]["share"])
    spread = half_interval(abs(power * float(told[0]["standard_error"]) / share))
    plain = math.isclose(power, _SQUARE, abs_tol=spread)
    exponent = "" if plain else f"^{power / _SQUARE:.2g}"
    return f"({BATTERY}/{float(f'{np.mean(voltage):.3g}'):g}){exponent}"


def _voltage(flight: Flight, good: NDArray[np.bool_]) -> Array | None:
    """Voltage of the battery (n,) [V], lines between its samples; None where none is logged, or it
    never changes."""
    if BATTERY not in flight:
        return None
    known = flight.usable([BATTERY]) & (flight[BATTERY] > 0.0)  # 0 V: none is connected
    if not known.any():
        return None
    voltage = bridge(np.where(known, flight[BATTERY], np.nan))
    return voltage if np.ptp(voltage[good]) > 0.0 else None


def _sag(
    anywhere: Sequence[Array],
    measured: Array,
    predicted: Array,
    voltage: Array | None,
    banded: Callable[[Array], Array],
) -> tuple[Suspicion, ...]:
    """The battery, where the force along z (n,) tells that the thrust of all rotors goes with its
    voltage (n,) [V]; the bend of a thrust over its command is left free. A drift with time looks
    alike where the voltage does: what drifts and is likelier is not the battery's."""
    if voltage is None:
        return ()
    level = banded(voltage)
    middle = float(np.mean(level))
    constant, run, *flow = anywhere
    free = np.column_stack(
        [banded(each) for each in (constant, *flow, predicted, predicted * np.abs(predicted))]
    )
    here, there = banded(measured), banded(predicted)
    size = float(here @ there) / (float(there @ there) or 1.0)  # of the thrust at this voltage
    ways = (size * predicted * (voltage / middle - 1.0), predicted * run)
    try:
        (power, error), drift = (_slow(free, banded(way), here - there) for way in ways)
    except ValueError:
        return ()  # what the voltage makes is what is free
    own, other = abs(power) / error, abs(drift[0]) / drift[1]
    low, high = float(np.min(level)), float(np.max(level))
    change, spread = power * (high - low) / middle, error * (high - low) / middle
    likely = own >= ERRORS and 0.5 * (other**2 - own**2) < LIKELIER
    if not likely or change < LEAST or power - ERRORS * error > _SQUARE:
        return ()
    words = (
        f"the battery takes thrust from all rotors: it falls by {change:.0%} +-"
        f" {half_interval(spread):.1%} from the highest to the lowest voltage, {high:.4g} to"
        f" {low:.4g} V. Multiply `speed` of the rotors in the database by"
        f" ({BATTERY}/{middle:.4g})^{0.5 * power:.2g}"
    )
    evidence = {"share": -change, "standard_error": spread, "power": power}
    return (Suspicion(BATTERY, "sag", words, evidence),)


def _slow(free: Array, column: Array, response: Array) -> tuple[float, float]:
    """What a column (m,) that changes slowly makes of a response (m,) beside what is free (m, k),
    and its standard error: by the independent samples of the residual that k + 1 estimates leave.
    """
    left, own = _beyond(free, response), _beyond(free, column)
    fit = least_squares(own[:, None], left, (BATTERY,))
    independent = len(own) / samples_per_independent(fit.residual)
    remaining = max(independent - free.shape[1] - 1.0, 1e-9)
    error = float(np.linalg.norm(fit.residual) / np.linalg.norm(own) / np.sqrt(remaining))
    return float(fit.estimates[0]), max(error, 1e-12)


def _tilted(flight: Flight, database: AeroDatabase) -> tuple[Suspicion, ...]:
    """Rotors that are told to tilt beyond their limits while all inputs are usable."""
    names = [name for name in database.inputs if name in flight]
    good = flight.usable(names)
    if len(names) < len(database.inputs) or good.sum() < FEWEST:
        return ()
    found = beyond_tilt(database, {name: flight[name][good] for name in names})
    return tuple(Suspicion(name, "limit", words, {}) for name, words in found.items())


def _kind(database: AeroDatabase, part: str) -> str:
    entry = database.parts.get(part) or {}
    return str(entry.get("kind", ""))


def _effects(
    flight: Flight, database: AeroDatabase, names: Sequence[str]
) -> dict[str, dict[str, Array]]:
    """Rotor -> axis -> change (n,) by a share of its thrust, per unit of the share."""
    n = len(flight.time)
    channels = {each: flight[each] for each in database.inputs if each in flight}
    now = database.predict(channels).coefficients
    found = {}
    for name in names:
        thrust = database.variables[f"{name}_thrust"]
        scaled = replace(thrust, expression=times(Number(1.0 + _STEP), thrust.expression))
        variables = {**database.variables, f"{name}_thrust": scaled}
        then = replace(database, variables=variables).predict(channels).coefficients
        found[name] = {
            axis: np.broadcast_to((then[axis] - now[axis]) / _STEP, (n,)) for axis in _AXES
        }
    return found


def _anywhere(flight: Flight) -> list[Array]:
    """What may be wrong on every axis beside a rotor, (n,) each: constant, trend, flow, rates."""
    run = np.linspace(-1.0, 1.0, len(flight.time))
    ahead = flight["V"] * np.cos(flight["beta"])
    flow = (
        ahead * np.cos(flight["alpha"]), flight["V"] * np.sin(flight["beta"]),
        ahead * np.sin(flight["alpha"]),
    )  # fmt: skip
    return [np.ones_like(run), run, *flow, *(flight[name] for name in "pqr")]


def _on_axis(
    flight: Flight, axis: str, measured: Mapping[str, Array], predicted: Mapping[str, Array]
) -> list[Array]:
    """What may be wrong on one axis, (n,) each: the whole and its trend, and the force along z."""
    run = np.linspace(-1.0, 1.0, len(flight.time))
    own = [predicted[axis], run * predicted[axis]]
    return [*own, measured["CZ"]] if axis != "CZ" else own


def _beyond(free: Array, values: Array) -> Array:
    """What (m,) of values no combination of columns (m, k) makes."""
    sizes = np.linalg.norm(free, axis=0)
    scaled = free[:, sizes > 0.0] / sizes[sizes > 0.0]
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=None)[0])
