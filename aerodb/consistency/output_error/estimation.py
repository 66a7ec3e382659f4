"""Estimate the sensor errors of one or several flights, and combine them with their priors."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.linalg import block_diag

from aerodb.consistency.calibration import Calibration
from aerodb.consistency.output_error.gauss_newton import SMALL_GAIN
from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.output_error.installation import (
    ALIKE,
    VanePosition,
    lead_sentences,
    leads,
    vane_position,
)
from aerodb.consistency.output_error.normal_equations import residuals
from aerodb.consistency.output_error.posterior import (
    SIGNIFICANT,
    SensorEstimates,
    at_a_bound,
    is_early,
    never_early,
    overridden_by_calibration,
    shared_estimates,
    significant_parameters,
    with_calibration,
    with_vehicle_priors,
)
from aerodb.consistency.output_error.reconciliation import reconciled
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.plan import TRUST, ReconstructionPlan, make_plan
from aerodb.consistency.reconstructed import ReconstructedPath, Reconstruction
from aerodb.consistency.records import flight_of, records_from_flight
from aerodb.consistency.sensors import (
    AIR_DATA,
    PER_FLIGHT,
    FlightRecord,
    channels_of,
    parameter,
    predict_outputs,
)
from aerodb.consistency.verdict import moving_air
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.support import Array, half_interval, in_threads
from aerodb.vehicle import Accuracy, Vehicle

#: Sampling interval for the estimation of sensor errors, s: rigid-body motion is slower.
#: Corrections are applied to every sample.
SLOW = 0.04

#: Largest number of one-minute records of one flight used to estimate sensor errors: more add
#: little.
MOST_STRETCHES = 8

#: Gain of log-likelihood required to use a rotating earth: the rates of an attitude reference are
#: often free of the earth's rate already.
TURNS = 10.0

#: Gain of log-likelihood per sample below which a first look ends: no residual then changes by more
#: than its ten-thousandth part (rms).
LOOK = 1e-4

#: Largest number of rounds in which insignificant parameters are removed.
_ROUNDS = 5


def decimated_records(flight: Flight, vehicle: Vehicle) -> tuple[FlightRecord, ...]:
    """Records of a mapped flight at the interval `SLOW`.

    They are reconstructed over a rotating earth if the flight is long and this makes its residuals
    clearly more likely. Raises InputError as `records_from_flight`.
    """
    decimation = max(1, round(SLOW / flight.step))
    records = records_from_flight(flight, vehicle, decimation=decimation)
    if records[0].earth is None:
        return records
    flat = records_from_flight(flight, vehicle, decimation=decimation, rotating=False)
    plan = make_plan(records, vehicle)
    misfit = [_misfit(solve(most_active(each), plan, errors=False)) for each in (flat, records)]
    return records if misfit[0] - misfit[1] > TURNS else flat


def _misfit(result: Reconstruction) -> float:
    """Negative log-likelihood of a reconstruction, up to a constant: the sum over the channels of N
    ln(rms residual)."""
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
    records: Sequence[FlightRecord], plan: ReconstructionPlan, accuracy: Accuracy
) -> tuple[Reconstruction, ReconstructionPlan]:
    """Estimate the parameters of a plan and keep the significant ones.

    A channel that cannot be reconciled with the others leaves the estimate (`reconciled`). In
    moving air, the air data count for as many samples as are independent in their residuals, and
    their delays and scales are not estimated: the aircraft responds to gusts at once, so that vane
    and inertial motion agree for another reason than the vane's delay. A first look is enough for
    these decisions; each further search starts from the one before.

    Parameters
    ----------
    records : of one or several flights.
    plan : parameters to try, with priors and bounds.
    accuracy : limits of the vehicle, from which an effect counts.

    Returns
    -------
    The reconstruction with the parameters kept, and the plan of these.

    Raises InputError as `reconstruct`.
    """
    samples = sum(np.isfinite(y).sum() for record in records for y in record.outputs.values())

    def looked(those: ReconstructionPlan) -> Reconstruction:
        gain = max(LOOK * samples, SMALL_GAIN)
        return solve(records, those, least_gain=gain, errors=False)

    result, plan = reconciled(looked, plan, accuracy)
    near: Reconstruction | None = result
    if moving_air(result.paths, plan.left_out).matters:
        vane = _vane(records, result.whole, plan, accuracy)
        if vane is not None:
            plan = plan.without(ALIKE, misplaced=vane.sentence)
        plan = plan.in_moving_air().with_noise_floor(independent_noise(result.paths))
        near = None
    result = solve(records, plan, near=near)
    tested = with_vehicle_priors(shared_estimates(result), plan.stated_priors).by_name
    beyond = at_a_bound(result, plan, accuracy)
    for _ in range(_ROUNDS):
        kept = plan.only(significant_parameters(result, plan, accuracy))
        if kept.free == plan.free:
            break
        plan, result = kept, solve(records, kept, near=result)
    result, plan = _without_impossible(records, result, plan, accuracy)
    removed = {
        name: (max(value, 0.0) if parameter(name).kind == "delay" else value, error)
        for name, (value, error) in tested.items()
        if name not in plan.free
    }
    return result, replace(plan, removed=removed, beyond=() if plan.misplaced else beyond)


def _vane(
    records: Sequence[FlightRecord],
    result: Reconstruction,
    plan: ReconstructionPlan,
    accuracy: Accuracy,
) -> VanePosition | None:
    """The position of the vanes, where it explains the air data of a reconstruction better than
    their delays, their scales and moving air do."""
    return vane_position(
        records,
        result,
        plan,
        accuracy.flow_angle,
        lambda residual: 1.0 / samples_per_independent(residual - residual.mean()),
        lambda other: not moving_air(other.paths, plan.left_out).matters,
    )


def _without_impossible(
    records: Sequence[FlightRecord],
    result: Reconstruction,
    plan: ReconstructionPlan,
    accuracy: Accuracy,
) -> tuple[Reconstruction, ReconstructionPlan]:
    """The reconstruction and its plan without delays and scales that the position of the vanes
    explains better, and without delays that are negative: no sensor leads the motion."""
    vane = None if plan.moving_air else _vane(records, result, plan, accuracy)
    if vane is not None:
        plan = plan.without(ALIKE, misplaced=vane.sentence)
        result = solve(records, plan, near=result)
    while found := leads(result):
        plan = plan.without([lead.name for lead in found], lead_sentences(found))
        result = solve(records, plan, near=result)
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
    records: Sequence[FlightRecord],
    own: Reconstruction,
    plan: ReconstructionPlan,
    calibration: Calibration | None,
) -> FlightReconstruction:
    """Combine the sensor estimates (SI units, covariance (k, k)) with their priors, then
    reconstruct every record with them.

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
    # a calibration made from this flight already contains it: do not count the flight twice
    counted = calibration is not None and flight_of(records[0]) in calibration.flights
    estimates, still = (
        _combined(shared_estimates(own, still), stated, calibration, counted)
        for still in (False, True)
    )
    late = never_early(estimates)
    for name in estimates.names:
        still = still if name in late.names else still.conditioned_on_zero(name)
    estimates = late
    held = {name: value for name, value in held.items() if not is_early(name, value)}
    fixed = {**held, **{name: value for name, (value, _) in estimates.by_name.items()}}
    winds = [name for name in plan.free if parameter(name).kind in PER_FLIGHT]
    groups = [list(group) for _, group in groupby(records, key=lambda record: record.flight)]
    parts = in_threads(lambda group: solve(group, plan, winds, fixed, own), groups)
    return FlightReconstruction(_joined(own, parts, estimates, still.covariance), estimates, held)


def _combined(
    estimates: SensorEstimates,
    stated: Mapping[str, float],
    calibration: Calibration | None,
    counted: bool,
) -> SensorEstimates:
    """A flight's estimates with the vehicle file's priors and a calibration; `counted`: the
    calibration contains the flight."""
    estimates = with_vehicle_priors(estimates, stated)
    if calibration is None:
        return estimates
    combine = overridden_by_calibration if counted else with_calibration
    return combine(estimates, calibration)


def most_active(records: Sequence[FlightRecord], most: int = MOST_STRETCHES) -> list[FlightRecord]:
    """Return the records with the most motion (spread of the rates (n, 3) [rad/s]), at most `most`,
    in order of time.

    They suffice for the sensor errors, which are the same in all records.
    """
    chosen = sorted(records, key=_motion, reverse=True)[:most]
    return sorted(chosen, key=lambda record: record.first)


def solve(
    records: Sequence[FlightRecord],
    plan: ReconstructionPlan,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    near: Reconstruction | None = None,
    least_gain: float = SMALL_GAIN,
    errors: bool = True,
) -> Reconstruction:
    """Reconstruct records with the priors, bounds and noise floor of a plan.

    Parameters that the records cannot separate keep the uncertainty of their priors.

    Parameters
    ----------
    records : of one or several flights.
    plan : what to estimate.
    free : parameters to estimate instead of those of the plan.
    fixed : other parameters, name -> value, SI.
    near, least_gain : where the search starts and ends (`reconstruct`).
    errors : whether the covariance is more than that of white residuals (`reconstruct`).

    Raises InputError as `reconstruct`.
    """
    return reconstruct(
        records,
        plan.free if free is None else free,
        initial=plan.initial,
        priors=plan.priors,
        bounds=plan.bounds,
        noise_floor=plan.noise_floor,
        fixed=fixed,
        near=near,
        least_gain=least_gain,
        vertical_air=plan.vertical_air,
        details=False,
        errors=errors,
    )


def biases_that_may_be_air(found: FlightReconstruction, accuracy: Accuracy) -> tuple[str, ...]:
    """Names of the biases whose error is mostly vertical air's, and not small against the limit of
    a flow angle [rad].

    The vane's bias is the same in all flights of an installation, the air is each flight's own:
    such an estimate, applied, would make flights differ that agree as they were measured.

    accuracy : its `flow_angle` [rad] is the limit.
    """
    result = found.reconstruction
    labels = [entry.parameter.label for entry in result.estimates]
    names = []
    for name, (_, error) in found.sensors.by_name.items():
        calm = result.still[labels.index(name), labels.index(name)]
        if (
            name.endswith("_bias")
            and name.removesuffix("_bias") in ("alpha", "beta")
            and error**2 > 2.0 * calm
            and error > TRUST * accuracy.flow_angle
        ):
            names.append(name)
    return tuple(names)


def air_remarks(found: FlightReconstruction, applied: Collection[str]) -> tuple[str, ...]:
    """Say which biases of a vane would be applied in still air and are not, because the air may be
    what they are; empty if none. Biases are told in [deg], with errors and vertical air [m/s] of
    `Reconstruction`."""
    result = found.reconstruction
    said = []
    for name, (value, error) in found.sensors.by_name.items():
        number = [entry.parameter.label for entry in result.estimates].index(name)
        calm = float(np.sqrt(result.still[number, number]))
        if (
            name.endswith("_bias")
            and name not in applied
            and SIGNIFICANT * calm < abs(value) <= SIGNIFICANT * error
        ):
            halves = half_interval(error), half_interval(calm)
            degrees = [f"{np.rad2deg(each):.2g}" for each in (value, *halves)]
            said.append(
                f"{name} {degrees[0]} +- {degrees[1]} deg is not applied: it may be air that rises"
                f" or sinks by {result.air_sigma:.2g} m/s (in still air: +- {degrees[2]} deg)."
                " Several flights of this vane tell them apart (aerodb recalibrate)"
            )
    return tuple(said)


def _joined(
    own: Reconstruction,
    parts: Sequence[Reconstruction],
    estimates: SensorEstimates,
    still: Array,
) -> Reconstruction:
    """Join reconstructions of parts of a flight, with the sensor estimates (`still`: their
    covariance in air without vertical motion)."""
    paths = tuple(
        replace(path, before=_uncorrected_residuals(path.record))
        for part in parts
        for path in part.paths
    )
    known = estimates.by_name
    sensors = [
        replace(entry, value=known[name][0], standard_error=known[name][1], at_bound=False)
        for entry in own.estimates
        if not entry.parameter.scope and (name := entry.parameter.name) in known
    ]
    others = [entry for part in parts for entry in part.estimates]
    converged = own.converged and sum(part.converged for part in parts) > 0.5 * len(parts)
    spread = block_diag(estimates.covariance, *(part.covariance for part in parts))
    calm = block_diag(still, *(part.still for part in parts))
    white = block_diag(estimates.covariance, *(part.white for part in parts))
    return replace(
        own,
        estimates=(*sensors, *others),
        covariance=spread,
        still=calm,
        white=white,
        paths=paths,
        converged=converged,
    )


def _uncorrected_residuals(record: FlightRecord) -> dict[str, Array]:
    """Residuals by channel without sensor corrections or wind, starting at the first samples."""
    return residuals(record, predict_outputs(record, {}, first_states(record), (), slopes=False))


def independent_noise(paths: Sequence[ReconstructedPath]) -> dict[str, float]:
    """White noise (one sigma, SI) with the information content of the coloured air-data residuals.

    n samples of a coloured residual count as n / (1 + 2 sum of its autocorrelation) independent
    ones (Bartlett 1946; here up to the first zero crossing).
    """
    noise = {}
    for name in AIR_DATA:
        pieces = [path.residuals[name] for path in paths if name in path.residuals]
        pieces = [bridge(piece) - np.nanmean(piece) for piece in pieces if np.isfinite(piece).any()]
        if pieces:
            inflation = np.average(
                [samples_per_independent(piece) for piece in pieces],
                weights=[len(piece) for piece in pieces],
            )
            noise[name] = float(np.sqrt(inflation * np.mean(np.concatenate(pieces) ** 2)))
    return noise


def _motion(record: FlightRecord) -> float:
    """Standard deviation of a record's rates, rad/s: how much it moves."""
    return float(np.sqrt(np.sum(np.var(record.inputs[:, 3:], axis=0))))
