"""The pictures of the method pages, drawn of the demo's workspace by what draws the product's own:
``make pictures``."""

from collections.abc import Callable
from functools import partial
from typing import Final

from matplotlib.figure import Figure

from aerodb.flows.estimate import estimate_flow
from aerodb.flows.run import run_flow
from aerodb.report.flight_figures import channel_figure
from aerodb.report.response_page import FlownStretch, response_figure
from aerodb.report.style import PAGE_WIDTH, Picture, plain_panel
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.steps.fly import flown_responses, fly_version
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Channels of the pictures of a flight and of a response.
_MOTION: Final = ("V", "alpha", "q", "az_imu")
_RESPONSES: Final = ("q", "theta", "V")
#: Methods beside each other, and the terms that they estimate.
_METHODS: Final = (
    *("regression", "principal-components", "total-least-squares"),
    *("instrumental-variables", "frequency-domain", "recursive"),
)
_MODEL: Final = '[[increment]]\naxis = "CZ"\nterms = ["1", "alpha", "q_hat"]\n'
#: Half the width of a 95 % interval in standard errors.
_TWO_SIDED: Final = 1.96


def consistency(access: WorkspaceAccess) -> Figure:
    """A flight as measured and as reconstructed."""
    row = access.catalogue.flights("phoenix")[0]
    measured, _ = load_flight(access, row, "")
    return channel_figure(_MOTION, measured, load_consistent(access, row, "").flight)


def responses(access: WorkspaceAccess) -> Figure:
    """The last pull-up of a held-out flight, flown by the update and by the preflight database."""
    made = access.catalogue.version("phoenix", "candidate")
    before = access.catalogue.version_of_id(made.parent or "")
    flight = next(
        use.flight for use in access.catalogue.version_flights(made.id) if use.role == "held_out"
    )
    where = {"workspace": str(access.workspace.root), "run": ""}
    documents = [fly_version(flight, **where, version=id) for id in (made.id, before.id)]
    number = len(documents[0]["stretches"]) - 1
    after, earlier = (
        {
            name: line
            for name, line in flown_responses(access, document["key"])[number].items()
            if name in _RESPONSES
        }
        for document in documents
    )
    stretch = FlownStretch("", documents[0]["stretches"][number], after, earlier)
    return response_figure(stretch, made.label, before.label)


def methods(access: WorkspaceAccess) -> Figure:
    """What each method of equation error says of the same flights, with its 95 % interval."""
    flights = [row.id for row in access.catalogue.flights("phoenix")[:2]]
    baseline = access.catalogue.version_of_id(
        access.catalogue.version("phoenix", "candidate").parent or ""
    )
    given = {
        "flights": flights,
        "model": _MODEL,
        "methods": list(_METHODS),
        "version": baseline.id,
    }
    document = run_flow(estimate_flow, given, access.workspace, "direct")
    shown = [row for row in document["parameters"] if not row["parameter"].endswith("_0")]
    figure = Figure(figsize=(PAGE_WIDTH, 2.4), layout="constrained")
    for panel, row in zip(figure.subplots(1, len(shown), sharey=True), shown, strict=True):
        for place, name in enumerate(reversed(_METHODS)):
            found = row["estimates"][name]
            reach = _TWO_SIDED * found["standard_error"]
            panel.errorbar(found["value"], place, xerr=reach, fmt="ok", ms=4, capsize=3)
        panel.set_yticks(range(len(_METHODS)), reversed(_METHODS))
        panel.set_xlabel(row["parameter"])
        plain_panel(panel)
    return figure


#: File -> what draws it, and its text.
DRAWN: Final[dict[str, tuple[Callable[[WorkspaceAccess], Figure], str]]] = {
    "consistency.svg": (consistency, "A flight as measured and as reconstructed"),
    "responses.svg": (responses, "A manoeuvre as flown, and by two versions"),
    "methods.svg": (methods, "Estimates of six methods with 95 % intervals"),
}


def drawn(access: WorkspaceAccess) -> dict[str, str]:
    """File -> SVG."""
    return {file: Picture(partial(draw, access), text).svg for file, (draw, text) in DRAWN.items()}
