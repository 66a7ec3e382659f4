"""Run the consistency step for one flight: sensor errors, applied corrections, verdict, corrected
flight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import was_airborne
from aerodb.consistency.calibration import Calibration, Drift, drift
from aerodb.consistency.corrected import CorrectedFlight, corrected_flight
from aerodb.consistency.navigation_sources import MAPPED, OWN, NavigationCheck, check_navigation
from aerodb.consistency.output_error import (
    air_remarks,
    applied_corrections,
    biases_that_may_be_air,
    decimated_records,
    estimate_sensors,
    most_active,
    reconstruct_flight,
    shared_estimates,
    with_vehicle_priors,
)
from aerodb.consistency.plan import ReconstructionPlan, make_plan
from aerodb.consistency.reconstructed import Estimate, Reconstruction
from aerodb.consistency.records import IGNORED_FLAGS
from aerodb.consistency.sensor_noise import noise_beyond_declaration
from aerodb.consistency.sensors import (
    FlightRecord,
    FlowCheck,
    SensorFault,
    detect_faults,
    flow_against_velocity,
    position_against_velocity,
)
from aerodb.consistency.verdict import (
    Verdict,
    as_document,
    judge,
    judge_navigation,
    unchecked,
    with_limits_said,
)
from aerodb.errors import CalculationError, InputError, failing_alone
from aerodb.flight import Flight
from aerodb.remarks import MISPLACED, NEVER_AIRBORNE, Remark, of_error
from aerodb.support import Array, half_interval
from aerodb.vehicle import (
    FLOW,
    Vehicle,
    lacks_airspeed,
    with_flow_over_ground,
    without_flow_over_ground,
)


@dataclass(frozen=True)
class Consistent:
    """A flight after the consistency step.

    flight : with corrected channels; unchanged when it could not be checked.
    sigma : channel -> (n,), standard errors of V, alpha, beta, attitude and wind, SI.
    changed : channels that differ from the measured ones.
    beyond : channel -> (n,), SI, that the reconstruction gives and the flight does not take: wind,
        and flow angles whose standard errors are too large.
    document : the result as JSON.
    verdict : good, limited or rejected, with reasons.
    drifted : parameters that differ from the calibration.
    """

    flight: Flight
    sigma: Mapping[str, Array]
    changed: tuple[str, ...]
    document: Mapping[str, Any]
    verdict: Verdict
    drifted: tuple[Drift, ...] = ()
    beyond: Mapping[str, Array] = field(default_factory=dict)


def make_consistent(
    flight: Flight, vehicle: Vehicle, calibration: Calibration | None = None
) -> Consistent:
    """Check and correct one mapped flight, with V, alpha and beta at the CG.

    A flight that lacks the necessary channels, or that the reconstruction cannot bear (such as one
    that pitches through the vertical), gives the verdict "limited" with the reason; one on which
    the reconstruction fails in an unforeseen way is rejected with the reason. Neither raises an
    error. Channels are (n,), in SI units.

    Parameters
    ----------
    flight : mapped flight.
    vehicle : sensor positions, priors and accuracy limits.
    calibration : prior of the sensor parameters; None: the priors of the vehicle file.
    """
    measured = without_flow_over_ground(flight, vehicle)
    try:
        with failing_alone("the reconstruction", f"flight {flight.id[:12]}"):
            return _flowing(_checked(measured, vehicle, calibration), flight, vehicle)
    except CalculationError as error:
        verdict = Verdict("rejected", (of_error(error),), ())
        return Consistent(flight, {}, (), unreadable_document(error), verdict)
    except InputError as error:
        return _unchecked(flight, vehicle, str(error))


def _flowing(made: Consistent, flight: Flight, vehicle: Vehicle) -> Consistent:
    """The result with the flow of a vehicle that rotors carry, from its corrected attitude."""
    if not lacks_airspeed(flight, vehicle):
        return made
    corrected = replace(flight, channels={**flight.channels, **made.flight.channels})
    moved = with_flow_over_ground(replace(corrected, notes=made.flight.notes), vehicle)
    if "rho" in moved:
        moved = moved.with_channels({"qbar": 0.5 * moved["rho"] * moved["V"] ** 2})
    changed = (*made.changed, *(name for name in (*FLOW, "qbar") if name in moved))
    return replace(made, flight=moved, changed=tuple(dict.fromkeys(changed)))


def _checked(flight: Flight, vehicle: Vehicle, calibration: Calibration | None) -> Consistent:
    """Result for a flight with all necessary channels; raises InputError where it has not."""
    records = decimated_records(flight, vehicle)
    own, plan = estimate_sensors(
        most_active(records), make_plan(records, vehicle), vehicle.accuracy
    )
    known = reconstruct_flight(records, own, plan, calibration)
    drifted: tuple[Drift, ...] = ()
    if calibration is not None:
        sensors = with_vehicle_priors(shared_estimates(own), plan.stated_priors)
        drifted = drift(calibration, sensors.names, sensors.values, sensors.standard_errors)
    verdict = judge(
        known.reconstruction,
        flight.id,
        vehicle.accuracy,
        common_faults(records),
        plan.left_out,
        () if calibration is None else calibration.names,
        plan.declared_noise,
    )
    if plan.misplaced:
        verdict = verdict.with_first("limited", Remark(MISPLACED, text=plan.misplaced))
    for remark in plan.beyond:
        verdict = verdict.with_last("limited", remark)
    doubtful = (*biases_that_may_be_air(known, vehicle.accuracy), *plan.doubtful)
    values = applied_corrections(known.sensors, plan, calibration, doubtful)
    corrected = corrected_flight(flight, vehicle, known.reconstruction, values, known.held)
    moving = verdict.process_noise is not None and verdict.process_noise.matters
    noisy = noise_beyond_declaration(known.reconstruction.paths, vehicle.sensors, moving)
    navigation = check_navigation(flight, vehicle, corrected.result)
    wrong = [check for check in navigation if not check.good]
    for check in (check for check in wrong if check.source == MAPPED and check.against == OWN):
        verdict = verdict.with_last("limited", check.remark)
    verdict = with_limits_said(verdict, vehicle.accuracy)
    beside = [check.sentence for check in wrong if check.remark not in verdict.remarks]
    wanted = applied_corrections(known.sensors, plan, calibration)
    withheld = [
        f"{name} {value:.2g} +- {half_interval(error):.2g} (SI) is not applied: only a channel that"
        " disagrees with the motion determines it"
        for name, (value, error) in known.sensors.by_name.items()
        if name in plan.doubtful and name in wanted and name not in values
    ]
    plan = plan.without((), (*air_remarks(known, values), *withheld, *beside))
    document = _document(
        verdict, corrected.result, plan, corrected, values, drifted, calibration, noisy, navigation
    )
    made = replace(corrected.flight, notes=(*corrected.flight.notes, *noisy))
    return Consistent(
        made, corrected.sigma, corrected.changed, document, verdict, drifted, corrected.beyond
    )


def common_faults(records: Sequence[FlightRecord]) -> tuple[SensorFault, ...]:
    """Return gross faults that more than half of the records show; see `detect_faults`."""
    by_channels: dict[str, list[SensorFault]] = {}
    for record in records:
        for fault in detect_faults(record):
            by_channels.setdefault("/".join(fault.channels), []).append(fault)
    return tuple(entries[0] for entries in by_channels.values() if 2 * len(entries) > len(records))


def unreadable_document(error: InputError) -> dict[str, Any]:
    """The document of a flight that cannot be read: rejected, with the reason."""
    verdict = Verdict("rejected", (of_error(error),), ())
    return {**as_document(verdict), "checked": False, "because": str(error), "notes": []}


def _unchecked(flight: Flight, vehicle: Vehicle, because: str) -> Consistent:
    """Result for a flight without the channels that kinematics need: its navigation solution is
    checked against itself, if it is logged. One that never left the ground is rejected."""
    if was_airborne(flight):
        verdict = _navigation(flight, vehicle) or unchecked(because)
        verdict = with_limits_said(verdict, vehicle.accuracy)
    else:
        verdict = Verdict("rejected", (Remark(NEVER_AIRBORNE),), ())
    document = {**as_document(verdict), "checked": False, "because": because, "notes": []}
    return Consistent(flight, {}, (), document, verdict)


def _navigation(flight: Flight, vehicle: Vehicle) -> Verdict | None:
    names = ("north", "east", "altitude", "velocity_north", "velocity_east", "velocity_down")
    if any(name in flight for name in ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu")) or not all(
        n in flight for n in names
    ):
        return None
    good = flight.usable(names, despite=IGNORED_FLAGS)
    if good.sum() < 3:
        return None
    north, east, up, *velocity = (flight[name][good] for name in names)
    check = position_against_velocity(
        flight.time[good], np.column_stack([north, east, -up]), np.column_stack(velocity)
    )
    return judge_navigation(check, _flow(flight, good), vehicle.accuracy)


def _flow(flight: Flight, good: NDArray[np.bool_]) -> FlowCheck | None:
    """Compare alpha from logged velocity and wind with the probe's; None if either is missing."""
    names = (
        "phi",
        "theta",
        "psi",
        "velocity_north",
        "velocity_east",
        "velocity_down",
        "wind_north",
        "wind_east",
        "wind_down",
    )
    if "alpha" not in flight or not all(name in flight for name in names):
        return None
    columns = np.column_stack([flight[name][good] for name in names])
    return flow_against_velocity(
        columns[:, :3], columns[:, 3:6], columns[:, 6:], flight["alpha"][good]
    )


def _document(
    verdict: Verdict,
    result: Reconstruction,
    plan: ReconstructionPlan,
    corrected: CorrectedFlight,
    values: Mapping[str, float],
    drifted: Sequence[Drift],
    calibration: Calibration | None,
    noisy: Sequence[str],
    navigation: Sequence[NavigationCheck],
) -> dict[str, Any]:
    shown = [entry for entry in result.estimates if entry.parameter.kind != "initial"]
    return {
        **as_document(verdict),
        "checked": True,
        "used": {name: source.text for name, source in corrected.used.items()},
        "origins": {name: source.origin.name.lower() for name, source in corrected.used.items()},
        "estimates": [_estimate(entry, values) for entry in shown],
        "not_estimated": list(plan.not_estimated),
        "left_out": dict(plan.left_out),
        "removed": [
            {"parameter": name, "value": value, "standard_error": error}
            for name, (value, error) in plan.removed.items()
        ],
        "converged": result.converged,
        "iterations": result.iterations,
        "records": len(result.paths),
        "vertical_air": result.air_sigma,
        "earth": "flat" if result.paths[0].record.earth is None else "rotating",
        "calibration": None if calibration is None else calibration.id,
        "notes": [corrected.flight.notes[-1], *noisy],
        "remarks": list(plan.remarks),
        "navigation": [check.document() for check in navigation],
        "drift": [entry.because for entry in drifted],
        "noise": corrected.noise.document(),
    }


def _estimate(entry: Estimate, values: Mapping[str, float]) -> dict[str, Any]:
    name, number = entry.parameter.name, entry.parameter.scope.partition("#")[2]
    return {
        "parameter": name,
        "stretch": int(number or 0) if entry.parameter.scope else None,
        "value": entry.value,
        "standard_error": entry.standard_error,
        "applied": name in values,
    }
