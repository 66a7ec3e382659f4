"""What flights still have in common after the candidate, and no hypothesis of the library names.

docs/method/tracing.md, section 14.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects import FlightView, view_of
from aerodb.increments import UNCHANGED
from aerodb.loop.evidence import copies_with_noise
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.loop.frozen_library import Library
from aerodb.loop.shapes import shape_variables
from aerodb.tables import HAT_RATES, AeroDatabase
from aerodb.tracing import (
    FlightResidual,
    UnexplainedResidual,
    evidence_of,
    unexplained_by_axis,
    without_state_noise,
)

#: Rates of change of the flow angles. They follow from the accelerations, whose noise is in the
#: forces as well: it would predict itself.
_OF_ACCELERATIONS: Final = frozenset({"alphadot", "betadot", "alphadot_hat"})


def unexplained_residuals(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> tuple[UnexplainedResidual, ...]:
    """Return what is unexplained on each axis of these flights (ids), compared with the candidate.

    Empty below the fewest flights of the settings. See docs/method/tracing.md, section 14. Raises
    InputError where a flight lacks what is needed.
    """
    if len(flights) < library.settings.fewest:
        return ()
    settings = library.settings
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]

    def beside(view: FlightView) -> FlightResidual:
        names = {*candidate.flight_inputs, *HAT_RATES} - _OF_ACCELERATIONS
        variables = {name: view.channels[name] for name in sorted(names) if view.has([name])}
        return FlightResidual(
            evidence_of(view, sensors),
            variables,
            {n: v for n, v in shape_variables(view).items() if n not in _OF_ACCELERATIONS},
        )

    def left(id: str) -> FlightResidual:
        return beside(source.view(id, candidate, settings.bandwidth))

    def noisier(id: str) -> list[FlightResidual]:
        copies = copies_with_noise(
            source.view(id, candidate, settings.bandwidth),
            source.flight(id),
            source.reconstruction(id),
            settings,
            rotating_air=True,
        )
        return [beside(view_of(*copy, candidate, source.vehicle)) for copy in copies]

    residuals = on_each(source, flights, left)
    found = material(unexplained_by_axis(residuals, settings), residuals)
    if not any(each.found for each in found):
        return found
    copies = list(zip(*on_each(source, flights, noisier), strict=False))
    noisy = [unexplained_by_axis(copy, settings) for copy in copies]
    return without_state_noise(found, noisy, settings) if noisy else found


def material(
    found: Sequence[UnexplainedResidual], residuals: Sequence[FlightResidual]
) -> tuple[UnexplainedResidual, ...]:
    """Return what is found, less what is too small to matter: without it, the rms error of the
    axis, each flight's constant apart, would fall by no more than the fraction `UNCHANGED`, as
    little as no effect is confirmed for."""
    judged = []
    for each in found:
        if each.found:
            errors = [
                flight.evidence.residual[each.axis][flight.evidence.usable[each.axis]]
                for flight in residuals
            ]
            whole = float(np.mean(np.square(np.concatenate([e - e.mean() for e in errors]))))
            part = float(np.mean(np.multiply(each.skills, each.power)))
            if part <= (1.0 - (1.0 - UNCHANGED) ** 2) * whole:
                because = (
                    f"what can be predicted of {each.axis} on flights that were left out is"
                    f" {part / whole:.1%} of its variance: too little to matter"
                )
                each = replace(each, found=False, variables=(), because=because)
        judged.append(each)
    return tuple(judged)
