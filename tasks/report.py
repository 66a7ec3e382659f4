"""The figure of an update, into the workspace's reports."""

from aerodb.comparison import Comparison
from aerodb.report.figures import update_figure
from aerodb.update import Update
from storage.workspace import write_atomically
from tasks.compare import load_comparison
from tasks.deltas import Plan
from tasks.open import Stores, stores


def draw_update(plan: Plan, update: Update, version: str, label: str, *, workspace: str, run: str) -> str:
    """Draws the declared axes on the flights that validate (else on all), before and after; returns the file."""
    opened = stores(workspace)
    shown = plan.hold_out.held_out or plan.flights
    before: dict[str, Comparison] = {}
    after: dict[str, Comparison] = {}
    for flight in shown:
        before[flight] = load_comparison(opened, flight, plan.baseline, run)[1]
        after[flight] = load_comparison(opened, flight, version, run)[1]
    labels = {flight: _label(opened, flight) for flight in shown}
    axes = [entry.axis for entry in update.axes if any(entry.axis in c.usable for c in before.values())]
    title = f"{plan.vehicle}: {label} beside its baseline on {plan.hold_out.kind.replace('not validated', 'its own')} flights"
    figure = update_figure(axes, before, after, labels, title)
    path = opened.workspace.reports / f"{plan.vehicle}-{label}-{version[:12]}.png"
    write_atomically(path, lambda temporary: figure.savefig(temporary, format="png", dpi=130))
    return str(path)


def _label(opened: Stores, flight: str) -> str:
    """The flight's name, else that of its log."""
    row = opened.catalogue.flight(flight)
    log = opened.catalogue.log(row.log_sha256)
    return row.name or (log.name if log else row.label)
