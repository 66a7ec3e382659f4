"""What the legs of a database leave of rolls on the ground, and where it has them stand still.

Each roll is flown with the parameters of the legs held. Its wind and its start are found beside
them, so that what is left is what no wind and no start explains. Errors are along and across the
runway.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.estimation import Fit, Parameters, TimeHistory
from aerodb.identification.ground_records import SECOND_DIFFERENCE, Rolls, roll_model
from aerodb.identification.ground_roll import GroundRoll, fitted_roll
from aerodb.increments import AxisValidation, HoldOut, axis_outcome, repeatability
from aerodb.nomenclature import ROLL_OUTPUTS
from aerodb.signals import rms, theil
from aerodb.simulation import standstill
from aerodb.support import Array
from aerodb.tables import AeroDatabase

#: Pairs of outputs that are turned into the runway's direction, and their names there.
_TURNED: Final = (
    (("north", "east"), ("along", "across")),
    (("velocity_north", "velocity_east"), ("speed", "drift")),
)
#: Time over which second differences give the noise of an output [s]: positions come once a second
#: or faster, and a vehicle hardly leaves its model within that time.
_NOISE_TIME: Final = 1.0
#: A roll is flown on after its record for up to this time [s] to its standstill: from 3 m/s it
#: rolls 10 s with friction of 0.03.
_ROLLS_ON: Final = 30.0
#: Time before the end of a record from which its standstill is extrapolated [s].
_ENDING: Final = 8.0


@dataclass(frozen=True)
class Stop:
    """A standstill: time since the start of the roll [s], and distance from there [m]."""

    time: float
    distance: float


@dataclass(frozen=True, eq=False)
class RollError:
    """One roll beside a database.

    Parameters
    ----------
    name : of its record. flight : id of its flight. time : (n,) [s] of the flight.
    measured, fitted : output of `ROLL_OUTPUTS` -> (n,), SI units; NaN where it was not measured.
    found : wind and start that were found, as parameters of `GroundRoll`.
    stopped : where it stood still, by its positions; None where they do not tell.
    """

    name: str
    flight: str
    time: Array
    measured: Mapping[str, Array]
    fitted: Mapping[str, Array]
    found: Mapping[str, float]
    stopped: Stop | None

    def residual(self, output: str) -> Array:
        """Measured less fitted (m,) of an output where it was measured, SI units."""
        left = self.measured[output] - self.fitted[output]
        return np.asarray(left[np.isfinite(left)])

    def noise(self, output: str) -> float:
        """Standard deviation of the noise of an output, SI units, from second differences."""
        left = self.measured[output] - self.fitted[output]
        k = max(1, round(_NOISE_TIME / float(self.time[1] - self.time[0])))
        second = left[2 * k :] - 2.0 * left[k:-k] + left[: -2 * k]
        second = second[np.isfinite(second)]
        return float(np.sqrt(np.mean(second**2) / SECOND_DIFFERENCE)) if len(second) else 0.0


def roll_errors(
    function: Callable[..., Fit],
    rolls: Rolls,
    values: Mapping[str, float],
    database: AeroDatabase,
    wind: tuple[float, float] | None = None,
    start: Mapping[str, float] | None = None,
) -> list[RollError]:
    """Return what rolls leave beside legs with some values of their parameters; a roll whose search
    for wind and start does not end is not among them.

    function : a method that flies. values : parameter -> value, in its unit. wind : as of
    `roll_model`. start : as of `fitted_roll`.
    """
    found = []
    whole = roll_model(rolls, [*values], database, wind)
    held = [
        replace(i, value=values[i.name], free=False) for i in whole.parameters.items[: len(values)]
    ]
    for record in rolls.records:
        own = [i for i in whole.parameters.items if i.name.endswith(f"[{record.name}]")]
        outputs = tuple(n for n in whole.outputs if np.isfinite(record.outputs[n]).any())
        model = replace(whole, parameters=Parameters((*held, *own)), outputs=outputs)
        begun = (
            {i.name: start[i.name] for i in own if i.free and i.name in start} if start else None
        )
        fit = fitted_roll(function, model, [record], begun or None)
        if all(np.isfinite(each.value) for each in fit.estimates):
            found.append(_error(fit, model, record, rolls.flights[record.name]))
    return found


def _error(fit: Fit, model: GroundRoll, record: TimeHistory, flight: str) -> RollError:
    ending = f"[{record.name}]"
    found = {each.name: each.value for each in fit.estimates if each.name.endswith(ending)}
    psi = found[f"initial_psi{ending}"]
    fitted = fit.fitted[record.name]
    measured = {name: record.outputs[name] for name in model.outputs}
    return RollError(
        record.name,
        flight,
        record.time,
        _along_runway(measured, psi),
        _along_runway({name: fitted[name] for name in model.outputs}, psi),
        found,
        _measured_stop(record, psi),
    )


def _along_runway(outputs: Mapping[str, Array], psi: float) -> dict[str, Array]:
    """Outputs (n,) with those over the ground turned into a direction [rad]."""
    found = {}
    for (north, east), (along, across) in _TURNED:
        if north in outputs and east in outputs:
            found[along] = outputs[north] * np.cos(psi) + outputs[east] * np.sin(psi)
            found[across] = outputs[east] * np.cos(psi) - outputs[north] * np.sin(psi)
    found |= {name: outputs[name] for name in ("psi", "V") if name in outputs}
    return {name: found[name] for name in ROLL_OUTPUTS if name in found}


def flown_to_stop(
    rolls: Rolls, error: RollError, values: Mapping[str, float], database: AeroDatabase
) -> Stop | None:
    """Return where a roll stands still from the start and in the wind that were found of it, beside
    legs with some values of their parameters; None where it does not.

    values : parameter -> value, in its unit.
    """
    record = next(each for each in rolls.records if each.name == error.name)
    more = np.arange(1, round(_ROLLS_ON / record.step) + 1) * record.step
    longer = TimeHistory(
        record.name,
        np.concatenate([record.time, record.time[-1] + more]),
        {n: np.concatenate([v, np.full(len(more), v[-1])]) for n, v in record.inputs.items()},
        {},
    )
    taken = {name: np.array([value]) for name, value in {**error.found, **values}.items()}
    run = roll_model(rolls, [*values], database).flown(taken, longer)
    cg = [float(record.inputs[f"cg_{axis}"].mean()) for axis in "xyz"]
    stands = standstill(run, database, cg)
    return None if stands is None else Stop(stands.time - float(record.time[0]), stands.distance)


def _measured_stop(record: TimeHistory, psi: float) -> Stop | None:
    """Where positions have a roll stand still, by a parabola through its last seconds."""
    north, east = (record.outputs.get(name) for name in ("north", "east"))
    if north is None or east is None:
        return None
    way = north * np.cos(psi) + east * np.sin(psi)
    time = record.time - record.time[0]
    good = np.isfinite(way)
    late, early = good & (time > time[-1] - _ENDING), good & (time < _ENDING)
    if min(late.sum(), early.sum()) < 6:
        return None
    slowing, pace, place = np.polyfit(time[late] - time[-1], way[late], 2)
    if not (slowing < 0.0 < pace):
        return None
    on = pace / (-2.0 * slowing)
    if on > _ROLLS_ON:
        return None
    begun = float(np.polyfit(time[early], way[early], 2)[-1])
    return Stop(float(time[-1] + on), float(place + 0.5 * pace * on) - begun)


def validated_rolls(
    before: Sequence[RollError],
    after: Sequence[RollError],
    hold_out: HoldOut,
    left_out: Sequence[RollError] = (),
) -> tuple[AxisValidation, ...]:
    """Return the error of each output before and after, rms in SI units, on the identifying and on
    the held-out flights.

    left_out : of each flight, beside values found without it, where they are cross-validated.
    """
    held = set(hold_out.held_out or (hold_out.identified if left_out else ()))
    proof = left_out or [each for each in after if each.flight in held]
    names = [n for n in ROLL_OUTPUTS if any(n in each.measured for each in (*before, *after))]
    return tuple(_validation(n, unit, before, after, proof, hold_out, held)
                 for n, unit in ROLL_OUTPUTS.items() if n in names)  # fmt: skip


def _validation(
    name: str,
    unit: str,
    before: Sequence[RollError],
    after: Sequence[RollError],
    proof: Sequence[RollError],
    hold_out: HoldOut,
    held: set[str],
) -> AxisValidation:
    def pooled(
        errors: Sequence[RollError], flights: set[str], centred: bool = False
    ) -> float | None:
        parts = [
            each.residual(name)
            for each in errors
            if each.flight in flights and name in each.measured
        ]
        parts = [part - part.mean() if centred else part for part in parts if len(part)]
        return rms(np.concatenate(parts)) if parts else None

    used = set(hold_out.identified)
    shown = proof or after
    own = [each for each in shown if name in each.measured and len(each.residual(name))]
    noise = [np.full(len(each.residual(name)), each.noise(name)) for each in own]
    floor = rms(np.concatenate(noise)) if noise else 0.0
    first, last = pooled(before, held or used), pooled(shown, held or used)
    pairs = [(e.measured[name], e.fitted[name]) for e in own]
    pairs = [(m[np.isfinite(m)], f[np.isfinite(m)]) for m, f in pairs]
    spread = rms(np.concatenate([m - m.mean() for m, _ in pairs])) if pairs else 0.0
    explained = 1.0 - (last or 0.0) ** 2 / spread**2 if spread > 0.0 else 0.0
    each_before = [
        rms(
            np.concatenate(
                [e.residual(name) for e in before if e.flight == flight and name in e.measured]
            )
        )
        for flight in dict.fromkeys(e.flight for e in before if name in e.measured)
    ]

    def excess(value: float | None) -> float | None:
        return None if value is None else float(np.sqrt(max(value**2 - floor**2, 0.0)))

    return AxisValidation(
        axis=name,
        rms_before=pooled(before, used),
        rms_after=pooled(after, used),
        held_out_rms_before=pooled(before, held),
        held_out_rms_after=pooled(proof, held),
        held_out_shape_before=pooled(before, held, centred=True),
        held_out_shape_after=pooled(proof, held, centred=True),
        excess_before=excess(pooled(before, held)),
        excess_after=excess(pooled(proof, held)),
        noise_floor=floor,
        repeatability=repeatability(each_before),
        theil=theil(*(np.concatenate([p[k] for p in pairs]) for k in (1, 0))) if pairs else None,
        explained=explained,
        outcome=axis_outcome(first or 0.0, last or 0.0, floor, explained),
        unit=unit,
    )
