"""Residual and regressor columns of a flight compared with the current model."""

from collections.abc import Sequence

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import (
    FlightView,
    Hypothesis,
    air_rotation_columns,
    surfaces_at_rest,
    view_of,
)
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.vehicle import Vehicle


def evidence_of(
    flight: Flight,
    comparison: Comparison,
    database: AeroDatabase,
    vehicle: Vehicle,
    hypotheses: Sequence[Hypothesis],
    noisy: Sequence[tuple[Flight, Comparison]] = (),
    view: FlightView | None = None,
    rotating_air: bool = True,
) -> Evidence:
    """Return the residuals of a flight on the body axes and the column of every hypothesis.

    database : the model that `comparison` was made with. noisy : the same flight with the
    reconstruction's state noise added once more, each with its own comparison. view : of the flight
    and the database, where one exists already. A hypothesis whose channels the flight lacks gives
    no column, nor does one that only a surface at rest would drive. rotating_air : whether columns
    of the air's rotation are among the others (`air_rotation_columns`).

    Raises InputError when no body axis has a usable sample.
    """
    view = view or view_of(flight, comparison, database, vehicle)
    axes = [axis for axis in AXES if axis in comparison.usable and comparison.usable[axis].any()]
    if not axes:
        raise InputError(
            "no axis has a usable sample",
            f"flight {flight.id}",
            "see its flags: aerodb flight show",
        )
    resting = surfaces_at_rest(vehicle, flight.channels)
    columns = {
        hypothesis.id: hypothesis.columns(view)
        for hypothesis in hypotheses
        if hypothesis.kind == "sensor"
        or not hypothesis.drivers
        or not resting.issuperset(hypothesis.drivers)
    }
    if rotating_air:
        columns |= air_rotation_columns(view, comparison.measured)
    return Evidence(
        flight=flight.id,
        step=flight.step,
        residual={axis: np.nan_to_num(comparison.residual(axis)) for axis in axes},
        usable={axis: comparison.usable[axis] for axis in axes},
        columns={
            name: {axis: by_axis[axis] for axis in axes if axis in by_axis}
            for name, by_axis in columns.items()
            if by_axis
        },
        noisy=tuple(
            evidence_of(
                other,
                beside,
                database,
                vehicle,
                hypotheses,
                view=view_of(other, beside, database, vehicle, near=view),
                rotating_air=rotating_air,
            )
            for other, beside in noisy
        ),
    )
