"""Calibrations of several flights: the sensor errors that they share, by evidence.

docs/method/consistency.md, section "Calibrations".
"""

from collections.abc import Collection, Mapping, Sequence
from datetime import datetime

from aerodb.consistency.calibration import Calibration, drift
from aerodb.consistency.output_error.estimation import (
    decimated_records,
    estimate_sensors,
    most_active,
)
from aerodb.consistency.output_error.posterior import (
    SensorEstimates,
    agreeing_flights,
    never_early,
    pooled,
    shared_estimates,
    with_vehicle_priors,
)
from aerodb.consistency.plan import ReconstructionPlan, make_plan
from aerodb.consistency.sensors import FlightRecord, channels_of
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import Vehicle

#: Largest number of one-minute records of several flights together: more add little.
MOST_STRETCHES_JOINT = 48

#: Channels of the lateral motion of a symmetric aircraft.
LATERAL = frozenset(("ay", "p", "r", "beta", "probe_dp_beta", "phi", "psi"))


def joint_calibrations(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    valid_from: datetime | None = None,
    valid_until: datetime | None = None,
) -> tuple[Calibration, ...]:
    """Estimate the sensor parameters that several flights share.

    One reconstruction of all flights, each with its own winds and initial states. The records with
    the most motion are used, the same number of every flight, `MOST_STRETCHES_JOINT` in all. A
    parameter in which a flight alone contradicts the joint estimate (`drift`) is not shared by all:
    the calibrations give of the others what the flights alone say together, because the joint
    estimate of these has borne the contradiction. Flights that agree in the contradicted parameters
    (`agreeing_flights`) share those among them: a sensor was exchanged or moved between the groups.

    Parameters
    ----------
    flights : mapped flights of the vehicle.
    vehicle : sensor positions, priors and accuracy limits.
    valid_from, valid_until : range of start times (UTC) that the calibrations apply to.

    Returns
    -------
    The calibration of what all flights share last; before it one for each group of flights that
    share more (its `flights` are the group's).

    Raises InputError when no flight can be reconstructed or no parameter is determined.
    """
    room = max(1, MOST_STRETCHES_JOINT // max(len(flights), 1))
    by_flight = [most_active(decimated_records(flight, vehicle), room) for flight in flights]
    records = [record for own in by_flight for record in own]
    if not records:
        raise InputError("no flight", f"calibration of {vehicle.name}", "give at least one flight")
    result, plan = estimate_sensors(records, make_plan(records, vehicle), vehicle.accuracy)
    joint = with_vehicle_priors(shared_estimates(result), plan.stated_priors)
    everyone = tuple(range(len(by_flight)))
    shared = {everyone: joint} if len(by_flight) < 2 else _shared(joint, by_flight, plan, vehicle)
    made = tuple(
        Calibration(
            vehicle.name,
            own.names,
            own.values,
            own.covariance,
            tuple(sorted({flights[number].id for number in numbers})),
            valid_from,
            valid_until,
        )
        for numbers, each in shared.items()
        if (own := never_early(each)).names
    )
    if not made:
        raise InputError(
            "these flights determine no sensor parameter",
            f"calibration of {vehicle.name}",
            "fly more manoeuvres",
        )
    return made


def _shared(
    joint: SensorEstimates,
    by_flight: Sequence[Sequence[FlightRecord]],
    plan: ReconstructionPlan,
    vehicle: Vehicle,
) -> dict[tuple[int, ...], SensorEstimates]:
    """Flights (numbers) -> what they share; all of them last.

    joint : of all flights. by_flight : their records. plan : that of the joint estimates.
    """
    alone = [
        shared_estimates(estimate_sensors(own, make_plan(own, vehicle), vehicle.accuracy)[0])
        for own in by_flight
    ]
    whole = Calibration(vehicle.name, joint.names, joint.values, joint.covariance)
    apart = set()
    for own in alone:
        known = with_vehicle_priors(own, plan.stated_priors)
        found = drift(whole, known.names, known.values, known.standard_errors)
        apart |= {entry.name for entry in found}
    everyone = tuple(range(len(alone)))
    if not apart:
        return {everyone: joint}
    common = [name for name in joint.names if name not in apart]
    together = {names: agreeing_flights(alone, names) for names in _by_symmetry(apart)}
    shared = {}
    for flights, companions in _companions(together, everyone).items():
        parts = [
            own.only([*common, *(name for name, group in companions.items() if k in group)])
            for k, own in enumerate(alone)
        ]
        shared[flights] = pooled(parts, joint.names, plan.stated_priors)
    return {**shared, everyone: shared.get(everyone) or pooled(alone, common, plan.stated_priors)}


def _by_symmetry(names: Collection[str]) -> list[tuple[str, ...]]:
    """Parameters of the lateral motion and of the longitudinal one: errors of one do not look like
    errors of the other."""
    lateral = tuple(name for name in sorted(names) if set(channels_of(name)) & LATERAL)
    return [part for part in (lateral, tuple(sorted({*names} - {*lateral}))) if part]


def _companions(
    together: Mapping[tuple[str, ...], Sequence[tuple[int, ...]]], flights: Sequence[int]
) -> dict[tuple[int, ...], dict[str, tuple[int, ...]]]:
    """Flights that share the same with the same others -> parameter -> flights that share it.

    together : parameters -> groups of flights that agree in them. Flights that share with no other
    are left out.
    """
    found: dict[tuple[tuple[str, tuple[int, ...]], ...], list[int]] = {}
    for flight in flights:
        shared = tuple(
            (name, group)
            for names, groups in together.items()
            for group in groups
            if flight in group and len(group) > 1
            for name in names
        )
        if shared:
            found.setdefault(shared, []).append(flight)
    return {tuple(those): dict(shared) for shared, those in found.items()}
