"""Sensor errors of one or several flights: what is worth estimating is, with what was known
beforehand added to it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import groupby

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import block_diag

from aerodb.conditioning import bridge
from aerodb.consistency.calibration import Calibration
from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.output_error.normal_equations import residuals
from aerodb.consistency.output_error.posterior import (
    SensorEstimates,
    overridden_by_calibration,
    shared_estimates,
    significant_parameters,
    with_calibration,
    with_vehicle_priors,
)
from aerodb.consistency.output_error.reconstruction import (
    ReconstructedPath,
    Reconstruction,
    reconstruct,
)
from aerodb.consistency.plan import Plan, make_plan
from aerodb.consistency.records import flight_of, records_from_flight
from aerodb.consistency.sensors import (
    AIR_DATA,
    PER_FLIGHT,
    Record,
    channels_of,
    parameter,
    predict_outputs,
)
from aerodb.consistency.verdict import moving_air
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.vehicle import Accuracy, Vehicle

#: Interval at which sensor errors are estimated, s: rigid-body motion is slower; corrections are
#: applied to every sample.
SLOW = 0.04

#: So many stretches of a minute say what a flight has to say of its sensors, and so many what
#: several flights together have.
MOST_STRETCHES, MOST_STRETCHES_JOINT = 8, 48

#: A rotating earth must make the residuals more likely by this (natural logarithm): the rates of an
#: attitude reference are often free of the earth's own already.
TURNS = 10.0

#: So often parameters that turn out not to be significant are left out.
_ROUNDS = 5

#: A heading that disagrees by this rms (rad) is no heading; with this noise (rad) it has no weight.
ASTRAY, _NO_WEIGHT = 0.5, 100.0


def decimated_records(flight: Flight, vehicle: Vehicle) -> tuple[Record, ...]:
    """The records of a mapped flight at the interval `SLOW`, over the earth that its rates are
    measured against."""
    records = records_from_flight(flight, vehicle, decimation=max(1, round(SLOW / flight.step)))
    if records[0].earth is None:
        return records
    flat = tuple(replace(record, earth=None) for record in records)
    plan = make_plan(records, vehicle)
    misfit = [_misfit(solve(most_active(each), plan)) for each in (flat, records)]
    return records if misfit[0] - misfit[1] > TURNS else flat


def _misfit(result: Reconstruction) -> float:
    """Negative log-likelihood of a reconstruction, up to a constant: the sum of N ln(rms) of the
    channels' residuals."""
    pieces: dict[str, list[Array]] = {}
    for path in result.paths:
        for name, residual in path.residuals.items():
            pieces.setdefault(name, []).append(residual[np.isfinite(residual)])
    total = 0.0
    for parts in pieces.values():
        values = np.concatenate(parts)
        total += (
            0.5 * len(values) * float(np.log(max(float(np.mean(values**2)), 1e-30)))
            if len(values)
            else 0.0
        )
    return total


def estimate_sensors(
    records: Sequence[Record], plan: Plan, accuracy: Accuracy
) -> tuple[Reconstruction, Plan]:
    """The reconstruction with the parameters of `plan` that are worth keeping, and the plan of
    these.

    A heading that has nothing to do with the motion gets no weight. Where the air moved, the air
    data count for as many samples as are independent in their residuals, and their delays and
    scales are not sought: the aircraft answers gusts at once, so that the vane's gusts and the
    inertial motion agree for another reason than the vane's delay.
    """
    result = solve(records, plan)
    lost = _rms(result.paths, "psi")
    if lost > ASTRAY:
        sentence = (
            f"heading has no weight: it is {np.rad2deg(lost):.0f} deg (rms) from the reconstructed"
            " motion"
        )
        plan = plan.with_noise_floor({"psi": _NO_WEIGHT}, [sentence])
        result = solve(records, plan)
    if moving_air(result.paths).matters:
        plan = plan.in_moving_air().with_noise_floor(independent_noise(result.paths))
        result = solve(records, plan)
    for _ in range(_ROUNDS):
        kept = plan.only(significant_parameters(result, plan, accuracy))
        if kept.free == plan.free:
            break
        plan, result = kept, solve(records, kept)
    return result, plan


@dataclass(frozen=True)
class FlightReconstruction:
    """A whole flight reconstructed: the `reconstruction` of all its records, the `sensors`'
    estimates combined with their priors, and the parameters that were `held` at a calibration's
    value (name -> value, SI)."""

    reconstruction: Reconstruction
    sensors: SensorEstimates
    held: dict[str, float]


def reconstruct_flight(
    records: Sequence[Record], own: Reconstruction, plan: Plan, calibration: Calibration | None
) -> FlightReconstruction:
    """Combine the sensor estimates with their priors, then reconstruct every record with them.

    Under a calibration the parameters are those that it names; in moving air, its delays and scales
    of the air data are held at the calibration's values. Records with the same wind are solved
    together, with the sensor errors fixed at the combined estimates.

    Parameters
    ----------
    records : all records of one flight.
    own : reconstruction of the flight's most active records (`estimate_sensors`).
    plan : what that reconstruction estimates.
    calibration : prior of the sensors; None: the vehicle file's priors alone.
    """
    held: dict[str, float] = {}
    stated = plan.stated_priors
    if calibration is not None:
        logged = {name for record in records for name in record.outputs}
        plan = plan.with_calibration(calibration.names, logged)
        held = {
            n: v
            for n, (v, _) in calibration.by_name.items()
            if n not in plan.free and logged & set(channels_of(n))
        }
        own = solve(most_active(records), plan, fixed=held)
        stated = {name: sigma for name, sigma in stated.items() if name not in calibration.names}
    found = with_vehicle_priors(shared_estimates(own), stated)
    if calibration is not None:
        # a calibration made from this flight already contains it: do not count the flight twice
        in_calibration = flight_of(records[0]) in calibration.flights
        found = (
            overridden_by_calibration(found, calibration)
            if in_calibration
            else with_calibration(found, calibration)
        )
    fixed = {**held, **{name: value for name, (value, _) in found.by_name.items()}}
    winds = [name for name in plan.free if parameter(name).kind in PER_FLIGHT]
    parts = [
        solve(list(group), plan, winds, fixed)
        for _, group in groupby(records, key=lambda record: record.flight)
    ]
    return FlightReconstruction(_joined(own, parts, found), found, held)


def most_active(records: Sequence[Record], most: int = MOST_STRETCHES) -> list[Record]:
    """The stretches with the most motion, in their order: sensor errors are alike in all of
    them."""
    chosen = sorted(records, key=_motion, reverse=True)[:most]
    return sorted(chosen, key=lambda record: record.first)


def solve(
    records: Sequence[Record],
    plan: Plan,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Reconstruction:
    """The reconstruction of records with the parameters of a plan (or only those in `free`), under
    its priors, bounds and least noise; `fixed`: values (SI) of others. What the records cannot tell
    apart stays as uncertain as its prior.

    Raises InputError as `reconstruct` does.
    """
    return reconstruct(
        records,
        plan.free if free is None else free,
        initial=plan.initial,
        priors=plan.priors,
        bounds=plan.bounds,
        noise_floor=plan.noise_floor,
        fixed=fixed,
    )


def _joined(
    own: Reconstruction, parts: Sequence[Reconstruction], found: SensorEstimates
) -> Reconstruction:
    """The stretches solved part by part, with the standard errors of the joint solution where they
    are larger, and the sensor parameters as they are known."""
    joint = {path.record.name: path for path in own.paths}
    state = np.sqrt(np.mean([np.mean(path.state_sigma**2, axis=1) for path in own.paths], axis=0))
    air = np.sqrt(np.mean([np.mean(path.air_sigma**2, axis=1) for path in own.paths], axis=0))
    paths = []
    for path in (path for part in parts for path in part.paths):
        same = joint.get(path.record.name)
        least = (
            (state[:, None], air[:, None]) if same is None else (same.state_sigma, same.air_sigma)
        )
        sigma = (np.maximum(path.state_sigma, least[0]), np.maximum(path.air_sigma, least[1]))
        paths.append(
            replace(
                path,
                state_sigma=sigma[0],
                air_sigma=sigma[1],
                before=_uncorrected_residuals(path.record),
            )
        )
    known = found.by_name
    sensors = [
        replace(entry, value=known[name][0], standard_error=known[name][1], at_bound=False)
        for entry in own.estimates
        if not entry.parameter.scope and (name := entry.parameter.name) in known
    ]
    others = [entry for part in parts for entry in part.estimates]
    converged = own.converged and sum(part.converged for part in parts) > 0.5 * len(parts)
    spread = block_diag(found.covariance, *(part.covariance for part in parts))
    return replace(
        own,
        estimates=(*sensors, *others),
        covariance=spread,
        paths=tuple(paths),
        converged=converged,
    )


def _uncorrected_residuals(record: Record) -> dict[str, Array]:
    """Residuals by channel of the motion from the first samples on, with no sensor corrected and no
    wind."""
    return residuals(record, predict_outputs(record, {}, first_states(record), (), slopes=False))


def independent_noise(paths: Sequence[ReconstructedPath]) -> dict[str, float]:
    """Noise (one sigma) of the air data that would say as much as their residuals do: n samples of
    a coloured residual are n / (1 + 2 sum of its autocorrelation) independent ones (Bartlett 1946;
    here up to its first zero)."""
    found = {}
    for name in AIR_DATA:
        pieces = [path.residuals[name] for path in paths if name in path.residuals]
        pieces = [bridge(piece) - np.nanmean(piece) for piece in pieces if np.isfinite(piece).any()]
        if pieces:
            inflation = np.average(
                [_inflation(piece) for piece in pieces], weights=[len(piece) for piece in pieces]
            )
            found[name] = float(np.sqrt(inflation * np.mean(np.concatenate(pieces) ** 2)))
    return found


def _inflation(residual: Array) -> float:
    size = next_fast_len(2 * len(residual))
    correlation = np.fft.irfft(np.abs(np.fft.rfft(residual, size)) ** 2, size)[: len(residual)]
    if correlation[0] <= 0:
        return 1.0
    crossing = np.flatnonzero(correlation <= 0)
    stop = int(crossing[0]) if len(crossing) else len(residual)
    return float(max(1.0, 2.0 * correlation[:stop].sum() / correlation[0] - 1.0))


def _rms(paths: Sequence[ReconstructedPath], name: str) -> float:
    values = [path.residuals[name] for path in paths if name in path.residuals]
    return float(np.sqrt(np.nanmean(np.concatenate(values) ** 2))) if values else 0.0


def joint_calibration(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    valid_from: datetime | None = None,
    valid_until: datetime | None = None,
) -> Calibration:
    """The sensor parameters that several mapped flights share, with their covariance: one
    reconstruction of all of them, each with its own winds and first states.

    Of long flights the busiest stretches are taken, evenly from all flights, `MOST_STRETCHES_JOINT`
    in all. Raises InputError when no flight can be reconstructed, or nothing is determined.
    """
    room = max(1, MOST_STRETCHES_JOINT // max(len(flights), 1))
    records = [
        record
        for flight in flights
        for record in most_active(decimated_records(flight, vehicle), room)
    ]
    if not records:
        raise InputError(
            "no flight", f"calibration of {vehicle.name}", "name flights to calibrate from"
        )
    result, plan = estimate_sensors(records, make_plan(records, vehicle), vehicle.accuracy)
    found = with_vehicle_priors(shared_estimates(result), plan.stated_priors)
    if not found.names:
        raise InputError(
            "these flights determine no sensor parameter",
            f"calibration of {vehicle.name}",
            "fly more manoeuvres",
        )
    ids = tuple(sorted({flight.id for flight in flights}))
    return Calibration(
        vehicle.name, found.names, found.values, found.covariance, ids, valid_from, valid_until
    )


def _motion(record: Record) -> float:
    """How much a record moves: the spread of its rates, rad/s."""
    return float(np.sqrt(np.sum(np.var(record.inputs[:, 3:], axis=0))))
