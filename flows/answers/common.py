"""What every answer is, and what several have."""

from pydantic import BaseModel, ConfigDict

#: Axis or name -> number, null where it is not known.
Numbers = dict[str, float | None]


class Answer(BaseModel):
    """A document; keys beyond these may be there."""

    model_config = ConfigDict(extra="allow")


class Theil(Answer):
    """Theil's fit [%] and the parts of the error: bias, variance, covariance, which add up to 1."""

    fit_percent: float
    bias: float
    variance: float
    covariance: float
