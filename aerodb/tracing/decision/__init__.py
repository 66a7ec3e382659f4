"""Choose terms and sensors, explain each choice, and state what the flights exclude.

`trace` is the whole decision for enough flights: selection, explanation sets, refits without a
fold, verdicts, next flight; it returns a `Traced` of `Finding`s and bounds. `few_flight_findings`
takes its place where manoeuvres have to count as units. `refine` fits what was accepted once more,
`unexplained_by_axis` looks for what no hypothesis names, `dependences_on_conditions` for what
differs between flights.

Modules: `selection` (forward selection, `CrossFlightTests`), `explanation_sets`, `verdicts`,
`next_flight`, `findings` (results and their JSON); `few_flights` and `joint_model`; `refinement`;
`unexplained_residual` with `residual_records` and `ridge_model`; `between_flights`; `shapes` and
`functions`. The method: docs/method/tracing.md, sections 9 to 16, 25 and 26.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
