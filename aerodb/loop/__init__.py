"""The closed loop: from the residuals of flights beside a database to a candidate that lacks less,
and to its validation.

The way through, with flights from anywhere (`FlightSource`; the product's own are those of its
stores)::

    library = freeze_library(source, identified, baseline)          # what may be found, before a
    residual is looked at loop = run_loop(source, identified, baseline, library, Accept())  # rounds
    of tracing and adding, until nothing is found for finding in loop.added:
        print(finding.because)
    validated = validate_loop(source, hold_out, library, loop, Accept())  # error before and after,
    flights left out remainders = unexplained_residuals(source, identified, loop.candidate, library)
    # what no hypothesis names errors = consider_parameters(reconstructions, vehicle, baseline,
    flights, comparisons)  # for declared increments

Modules: `flights` (what a source of flights gives), `freezing` and `library`, `evidence` (of one
flight beside a database), `rounds`, `manoeuvre_units` (where flights are too few to vote), `stall`
and `stall_loop`, `refit` (gains and shapes once more), `validation` and `within_flight`,
`unexplained`, `consider`.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
