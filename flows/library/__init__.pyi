from .client import Client
from .evaluation import EvaluatedPoints, evaluate
from .fitting import FittedModel, fit
from .flights import (
    ComparedFlight,
    MeasuredCoefficients,
    ReconstructedFlight,
    compare,
    reconstruct,
    total_coefficients,
)
from .logs import Log, load, load_database, load_vehicle
from .tracing import TracedFlights, trace
from .workspaces import Version, Workspace, open_workspace

__all__ = [
    "Client",
    "ComparedFlight",
    "EvaluatedPoints",
    "FittedModel",
    "Log",
    "MeasuredCoefficients",
    "ReconstructedFlight",
    "TracedFlights",
    "Version",
    "Workspace",
    "compare",
    "evaluate",
    "fit",
    "load",
    "load_database",
    "load_vehicle",
    "open_workspace",
    "reconstruct",
    "total_coefficients",
    "trace",
]
