"""Residual and regressor columns of a flight compared with the current model."""

from collections.abc import Callable, Sequence

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import FlightView, Hypothesis, air_rotation_columns, surfaces_at_rest, view_of
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.support import Array
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

    Every axis will have a level of its own. Where the database writes forces along the wind axes,
    the level of CZ is that of a lift, which turns with the angle of attack. What its mean over the
    flight does on CX is taken out of the residual and of all columns alike (docs/method/tracing.md,
    section 3).

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
    level = _without_mean_lift(view)
    return Evidence(
        flight=view.flight,
        step=view.step,
        residual=level({axis: np.nan_to_num(comparison.residual(axis)) for axis in axes}),
        usable={axis: comparison.usable[axis] for axis in axes},
        columns={
            name: level({axis: by_axis[axis] for axis in axes if axis in by_axis})
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


def _without_mean_lift(view: FlightView) -> Callable[[dict[str, Array]], dict[str, Array]]:
    """Return what takes the turning of the mean lift out of CX, for body axis -> (n,).

    It is linear, so that a relation between residual and columns stays what it is. The identity
    where there is no lift to take out.
    """
    usable = view.comparison.usable
    if not (view.database.on_wind_axes and view.has(["alpha"]) and {"CX", "CZ"} <= usable.keys()):
        return lambda by_axis: by_axis
    both = usable["CX"] & usable["CZ"]
    sine, cosine = np.sin(view["alpha"]), np.cos(view["alpha"])

    def level(by_axis: dict[str, Array]) -> dict[str, Array]:
        if "CZ" not in by_axis or not both.any():
            return by_axis
        along_x = by_axis.get("CX", np.zeros_like(sine))
        lift = (sine * along_x - cosine * by_axis["CZ"])[both].mean()
        return {**by_axis, "CX": np.where(both, along_x - lift * sine, along_x)}

    return level
