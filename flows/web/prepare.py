"""What the pages need beside the server, loaded while it waits for its first request: the first
view of a page then takes no longer than the second.

Left to the first view are about a second of imports, and half a second in which Numba reads the
compiled kernels of tables and simulation from its cache.
"""

from importlib import import_module
from typing import Final

import numpy as np

from aerodb.examples.phoenix import read_example
from aerodb.exchange import read_native
from aerodb.flows.run import freeze_imports
from aerodb.report import FlownStretch, response_report
from aerodb.simulation import flight_model, simulate
from aerodb.vehicle import parse_vehicle

#: Packages whose public names pages use.
_FACES: Final = ("aerodb.report", "aerodb.tasks.view", "aerodb.tasks.steps")


def prepare() -> None:
    """Load the modules of pages and reports, the compiled kernels and what draws figures."""
    for face in map(import_module, _FACES):
        for name in face.__all__:
            getattr(face, name)
    import_module("pyarrow.compute")  # of results that a page is the first to need
    parse_vehicle(read_example("vehicle.toml"))
    database = read_native(read_example("preflight.toml"))
    database.predict({name: np.zeros(2) for name in database.inputs})
    model = flight_model(database)
    body = {"mass": 100.0, "Ixx": 100.0, "Iyy": 200.0, "Izz": 300.0}
    start, still = {"V": 60.0, "altitude": 1000.0}, dict.fromkeys(model.inputs, 0.0)
    time = np.linspace(0.0, 0.02, 3)
    simulate(model, time, start, {**body, **still})
    told = {"since": 0.0, "until": 0.02, "kind": "", "checks": [], "correction": {}, "notes": []}
    flown = FlownStretch("", told, {"V": (time, time, time)}, {})
    "".join(response_report("", "", None, [flown]))
    freeze_imports()
