"""Residual and regressor columns of a flight compared with the current model."""

from collections.abc import Sequence

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import FlightView, Hypothesis, air_rotation_columns, surfaces_at_rest, view_of
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.tracing.evidence.evidence import Evidence


def evidence_of(
    view: FlightView,
    hypotheses: Sequence[Hypothesis],
    noisy: Sequence[tuple[Flight, Comparison]] = (),
    rotating_air: bool = True,
) -> Evidence:
    """Return the residuals of a flight on the body axes and the column of every hypothesis.

    view : of the flight and the current model. noisy : the same flight with the reconstruction's
    state noise added once more, each with its own comparison with that model. A hypothesis whose
    channels the flight lacks gives no column, nor does one that only a surface at rest would drive.
    rotating_air : whether columns of the air's rotation are among the others
    (`air_rotation_columns`).

    Raises InputError when no body axis has a usable sample.
    """
    comparison = view.comparison
    axes = [axis for axis in AXES if axis in comparison.usable and comparison.usable[axis].any()]
    if not axes:
        raise InputError(
            "no axis has a usable sample",
            f"flight {view.flight}",
            "see its flags: aerodb flight show",
        )
    resting = surfaces_at_rest(view.vehicle, view.recorded.channels)
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
        flight=view.flight,
        step=view.step,
        residual={axis: np.nan_to_num(comparison.residual(axis)) for axis in axes},
        usable={axis: comparison.usable[axis] for axis in axes},
        columns={
            name: {axis: by_axis[axis] for axis in axes if axis in by_axis}
            for name, by_axis in columns.items()
            if by_axis
        },
        noisy=tuple(
            evidence_of(
                view_of(other, beside, view.database, view.vehicle, near=view),
                hypotheses,
                rotating_air=rotating_air,
            )
            for other, beside in noisy
        ),
    )
