"""Keys and types of the native TOML file and of the stored document."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from aerodb.quantities import Number as Coefficient
from aerodb.quantities import Point
from aerodb.support import Strict
from aerodb.vehicle import Reference as Lengths


class ReferenceFile(Lengths):
    moment_reference: Point


class UncertaintyFile(Strict):
    effect: str
    distribution: str
    bounds: tuple[float | str | tuple[float, ...], ...]
    sigmas: float = 1.0
    correlates_with: tuple[str, ...] = ()
    correlations: tuple[tuple[str, float], ...] = ()


class EstimatedFile(Strict):
    """Of a parameter in the document: see `aerodb.tables.Parameter`."""

    bounds: tuple[float | None, float | None] = (None, None)
    flights: tuple[str, ...] = ()
    flown: dict[str, tuple[float, float]] = Field(default_factory=dict)
    theory: float | None = None


class VariableFile(Strict):
    expression: str
    unit: str = "1"
    description: str = ""
    declared: dict[str, str] = Field(default_factory=dict)
    uncertainty: UncertaintyFile | None = None
    parameter: EstimatedFile | None = None


class ParameterFile(Strict):
    """A parameter of the file.

    value : SI, or text with a unit. bounds : in the same; None: none. prior_sigma : one standard
    deviation of what is known before flight. theory : the value that theory has, which `estimate`
    prints beside another.
    """

    value: Annotated[Coefficient, Field(allow_inf_nan=False)]
    unit: str = "1"
    bounds: tuple[Coefficient, Coefficient] | None = None
    prior_sigma: Annotated[Coefficient | None, Field(gt=0, allow_inf_nan=False)] = None
    theory: Coefficient | None = None
    description: str = ""


class TableFile(Strict):
    """A table of the file.

    units : of the breakpoints, one per argument; empty where they are SI or rad.
    """

    arguments: tuple[str, ...]
    breakpoints: tuple[tuple[float, ...], ...]
    values: Any
    units: tuple[str, ...] = ()
    extent: tuple[tuple[float, float] | None, ...] = ()
    interpolation: tuple[str, ...] = ()
    extrapolation: tuple[str, ...] = ()
    uncertainty: UncertaintyFile | None = None


class ScatteredFile(Strict):
    arguments: tuple[str, ...]
    points: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    uncertainty: UncertaintyFile | None = None


class TermFile(Strict):
    name: str
    axis: str
    expression: str
    description: str = ""


class StateFile(Strict):
    """A state model: the law of the channel `name` and its parameters, or its rate.

    The laws are those of `aerodb.tables.state_model`. rate : its time derivative, an expression;
    `initial` and `unit` are of such a state.
    """

    name: str
    law: Literal["kirchhoff", "goman_khrabrov", "relay", "rate"]
    parameters: dict[str, float | tuple[float, ...]] = Field(default_factory=dict)
    description: str = ""
    rate: str = ""
    initial: Coefficient = 0.0
    unit: str = "1"


class DatabaseFile(Strict):
    name: str = Field(min_length=1)
    description: str = ""
    source: str = ""
    reference: ReferenceFile
    free_inputs: dict[str, str] = Field(default_factory=dict)
    parameters: dict[str, ParameterFile] = Field(default_factory=dict)
    parts: dict[str, dict[str, Any]] = Field(default_factory=dict)
    variables: dict[str, VariableFile] = Field(default_factory=dict)
    states: tuple[StateFile, ...] = ()
    tables: dict[str, TableFile] = Field(default_factory=dict)
    scattered: dict[str, ScatteredFile] = Field(default_factory=dict)
    terms: tuple[TermFile, ...] = ()
    derivatives: dict[str, dict[str, Coefficient]] = Field(default_factory=dict)


class IntervalFile(Strict):
    low: float
    high: float
    cell: Annotated[float, Field(ge=0)]


class RefinedShapeFile(Strict):
    """A refined shape.

    axis : axis of the hypothesis. fall : relative reduction of the error of left-out flights.
    """

    hypothesis: str
    axis: str
    variables: tuple[str, ...]
    fall: float


class RefitFile(Strict):
    shapes: tuple[RefinedShapeFile, ...] = ()


class IncrementFile(Strict):
    """An increment of the document.

    `note` repeats `refit` and `lengthened_cells` in words; documents of earlier releases have the
    words alone.
    """

    axis: str
    regressors: tuple[str, ...]
    estimates: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    envelope: dict[str, IntervalFile] = Field(default_factory=dict)
    flights: tuple[str, ...] = ()
    note: str = ""
    folded: tuple[str, ...] = ()
    refit: RefitFile | None = None
    lengthened_cells: Annotated[int, Field(ge=0)] = 0
    induces_drag: bool = True
    margins: dict[str, float] | None = None

    @model_validator(mode="after")
    def _square(self) -> Self:
        if any(len(row) != len(self.estimates) for row in self.covariance):
            raise ValueError("covariance must have as many columns as there are estimates")
        return self


class Document(DatabaseFile):
    format: int
    increments: tuple[IncrementFile, ...] = ()
