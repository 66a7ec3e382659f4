"""From normal equations to votes: each flight's own estimate of each hypothesis, given what is nuisance.

How normal equations of several flights come onto one order of columns is `campaign`'s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerodb.effects import Hypothesis
from aerodb.support import Array, Mask
from aerodb.tracing.estimates.elimination import ModelElimination, SensorElimination
from aerodb.tracing.estimates.products import Products
from aerodb.tracing.evidence import TOLERANCE

#: Part of a column's own information below which what is left beside the nuisances is rounding.
ROUNDING = 1e-9
#: Largest scaled precision of a companion.
KNOWN = 1e9

#: Places of accepted terms, of freed and of fixed sensors, and of the terms whose shape may be
#: wrong.
Model = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...], tuple[int, ...]]


class EstimateBiases(Protocol):
    """What errors that no residual shows add to estimates: computed for the hypotheses that are
    asked for."""

    def at(self, places: Sequence[int]) -> Sequence[tuple[Array, Array]]:
        """Of each place: leak (flights, sensors), what a unit error of the sensor adds to the
        estimate in spite of its prior; and shift (flights,), what one more helping of state noise
        adds (SIMEX), 0 without."""


@dataclass(frozen=True)
class FlightEstimates:
    """Estimates (flights, hypotheses) of every hypothesis, each beside the nuisances, in SI units
    of its parameter.

    estimate : gamma = A_hy / A_hh; nan where the flight says nothing. information : A_hh, one over
    the variance that whitened noise would give, 0 where it says nothing; own : H_hh, the same if
    nothing stood beside it. errors : of all flights; chosen : which of them these are, in order,
    where they are not all.
    """

    estimate: Array
    information: Array
    own: Array
    errors: EstimateBiases
    chosen: NDArray[np.intp] | None = None

    @property
    def inflation(self) -> Array:
        """(flights, hypotheses) VIF, H_hh / A_hh after the trims."""
        return np.divide(
            self.own,
            self.information,
            out=np.full_like(self.own, np.inf),
            where=self.information > 0.0,
        )

    def rows(self, chosen: Sequence[int] | NDArray[np.intp]) -> "FlightEstimates":
        """The same for some of all flights."""
        index = np.asarray(chosen, dtype=np.intp)
        if np.array_equal(index, np.arange(len(self.estimate))):
            return self
        return FlightEstimates(
            self.estimate[index], self.information[index], self.own[index], self.errors, index
        )

    def mean_errors(self, places: Sequence[int], included: Mask) -> tuple[Array, Array]:
        """Leak (places, sensors) and shift (places,), means over those of these flights that vote,
        for one place at least.

        voters : (flights, hypotheses).
        """
        on = np.ascontiguousarray(included[:, list(places)].T, dtype=np.float64)
        on /= np.maximum(on.sum(axis=1, keepdims=True), 1.0)
        found = self.errors.at(places)
        weights = on
        if self.chosen is not None:
            weights = np.zeros((len(places), len(found[0][1])))
            weights[:, self.chosen] = on
        sensor_biases = np.array(
            [weight @ sensor_bias for weight, (sensor_bias, _) in zip(weights, found, strict=True)]
        )
        simex_biases = np.array([simex_bias for _, simex_bias in found])
        return sensor_biases, np.einsum(
            "pg,pg->p", weights, np.where(weights > 0.0, simex_biases, 0.0)
        )


@dataclass(frozen=True)
class Campaign:
    """All flights' products on one order of hypotheses.

    products, noisy : scaled; total (k,): of each column with itself, over all flights, SI. scale
    (k,): scaled parameter = parameter * scale; precision (k,): scaled prior precision of the
    sensors, 0 elsewhere. offsets : places of hypotheses that are an axis' own constant: their votes
    are the trims. shapes : column of a companion, behind the hypotheses -> place of its term, and
    the least sigma of what it varies with; earlier : place -> value of a term that the database
    holds already, whose shape may be wrong too. `votes` and `vote` remember what they were asked,
    so that repetitions without some flights cost no algebra.
    """

    flights: tuple[str, ...]
    hypotheses: tuple[Hypothesis, ...]
    products: Products
    noisy: Products | None
    total: Array
    scale: Array
    precision: Array
    sensors: tuple[int, ...]
    offsets: tuple[int, ...]
    shapes: Mapping[int, tuple[int, float]] = field(default_factory=dict)
    earlier: Mapping[int, float] = field(default_factory=dict)
    cached: dict[Model, FlightEstimates] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    single: dict[tuple[int, Model], tuple[Array, Array]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @cached_property
    def angle_reconstructed(self) -> bool:
        """Whether some flight's angle of attack comes from the motion, not from a sensor."""
        return any(hypothesis.effect == "reconstructed_alpha" for hypothesis in self.hypotheses)

    def flight_estimates(
        self,
        accepted: Sequence[int],
        freed: Sequence[int],
        fixed: Sequence[int] = (),
        exact: Sequence[int] = (),
    ) -> FlightEstimates:
        """Every hypothesis beside the `accepted` terms, their companions, and all sensors, with
        their priors; `freed` ones without, `fixed` ones as if they were known to be right. exact :
        accepted terms whose shape is taken to be right.

        A hypothesis that is itself a nuisance is estimated beside the others, its own prior left
        out.
        """
        model = self._model(accepted, freed, fixed, exact)
        if model not in self.cached:
            prior = self._prior(model)
            solved = self._reduced.beside(prior, *model[1:3])
            estimate, information = in_units(solved, np.arange(len(self.hypotheses)), self.scale)
            noisy = None if self._noisy is None else self._noisy.beside(prior, *model[1:3])
            added = ModelBiases(solved, noisy, estimate, information, self.scale)
            self.cached[model] = FlightEstimates(estimate, information, self._own, added)
        return self.cached[model]

    def flight_estimate(
        self, place: int, accepted: Sequence[int], freed: Sequence[int], fixed: Sequence[int] = ()
    ) -> tuple[Array, Array]:
        """Estimate and information (flights,) of one hypothesis alone, as `votes` has them."""
        model = self._model(accepted, freed, fixed, ())
        if model in self.cached:
            return self.cached[model].estimate[:, place], self.cached[model].information[:, place]
        if (place, model) not in self.single:
            solved = self._reduced.beside(self._prior(model), *model[1:3])
            estimate, information = in_units(solved, np.array([place]), self.scale)
            self.single[place, model] = estimate[:, 0], information[:, 0]
        return self.single[place, model]

    def _model(
        self,
        accepted: Sequence[int],
        freed: Sequence[int],
        fixed: Sequence[int],
        exact: Sequence[int],
    ) -> Model:
        terms = tuple(sorted(set(accepted) - set(self.offsets)))
        shaped = {place for place, _ in self.shapes.values()}
        loose = tuple(place for place in terms if place in shaped and place not in exact)
        return terms, tuple(sorted(freed)), tuple(sorted(fixed)), loose

    def _prior(self, model: Model) -> dict[int, float]:
        """Scaled prior precision of each accepted term and companion."""
        accepted, freed, fixed, loose = model
        value = {place: size for place, size in self.earlier.items() if place not in loose}
        if loose:
            rigid = self._reduced.beside(self._prior((accepted, freed, fixed, ())), freed, fixed)
            value |= dict(zip(loose, self._sizes(rigid, np.array(loose)), strict=True))
        return dict.fromkeys(accepted, 0.0) | self._tolerance(value)

    def _sizes(self, rigid: ModelElimination, places: NDArray[np.intp]) -> list[float]:
        """Common value of each of the accepted terms over the flights, by their information."""
        own, left, right = rigid.at(places)
        said = left > ROUNDING * np.maximum(own, ROUNDING)
        total, sums = (np.where(said, each, 0.0).sum(axis=0) for each in (left, right))
        return (sums / np.maximum(total * self.scale[places], 1e-300)).tolist()

    def _tolerance(self, value: Mapping[int, float]) -> dict[int, float]:
        """Column of a companion -> its scaled prior precision, from the size of the effect whose
        shape it is (`value`)."""
        found = {}
        for shape, (place, least) in self.shapes.items():
            if place not in value:
                continue
            own, apart = self.total[place], self.total[shape]
            spread = np.sqrt(apart / own) if own > 0.0 else 0.0
            sigma = TOLERANCE * abs(value[place]) / max(float(spread), least) * self.scale[shape]
            found[shape] = min(KNOWN, sigma**-2) if sigma > 0.0 else KNOWN
        return found

    @cached_property
    def _reduced(self) -> SensorElimination:
        return SensorElimination(self.products, self.sensors, self.precision)

    @cached_property
    def _noisy(self) -> SensorElimination | None:
        return (
            None
            if self.noisy is None
            else SensorElimination(self.noisy, self.sensors, self.precision)
        )

    @cached_property
    def _own(self) -> Array:
        """(flights, hypotheses) products of the columns with themselves, SI; of offsets that of
        their trims."""
        return np.asarray(self._reduced.own * self.scale[: len(self.hypotheses)] ** 2)


def in_units(
    solved: ModelElimination, places: NDArray[np.intp], scale: Array
) -> tuple[Array, Array]:
    """Scaled Schur complements as estimate and information (flights, places) in SI units; what is
    only rounding says nothing."""
    own, left, right = solved.at(places)
    said = left > ROUNDING * np.maximum(own, ROUNDING)
    estimate = np.divide(right, left * scale[places], out=np.full_like(left, np.nan), where=said)
    return estimate, np.where(said, left, 0.0) * scale[places] ** 2


@dataclass(frozen=True)
class ModelBiases:
    """`Errors` of a model, one place after another as they are asked for.

    plain, noisy : how the model is solved, and with the states' noise added once more; estimate,
    information : its votes; scale : as in the campaign. seen : place -> what was answered.
    """

    plain: ModelElimination
    noisy: ModelElimination | None
    estimate: Array
    information: Array
    scale: Array
    cached: dict[int, tuple[Array, Array]] = field(default_factory=dict, init=False)

    def at(self, places: Sequence[int]) -> Sequence[tuple[Array, Array]]:
        """Leak (flights, sensors) and shift (flights,) of each place, SI."""
        new = np.array([place for place in places if place not in self.cached], dtype=np.intp)
        if new.size:
            sensor_bias, simex_bias = self._sensor_bias(new), self._simex_bias(new)
            self.cached.update(
                zip(new.tolist(), zip(sensor_bias, simex_bias, strict=True), strict=True)
            )
        return [self.cached[place] for place in places]

    def _sensor_bias(self, places: NDArray[np.intp]) -> Array:
        """(places, flights, sensors)."""
        scale, information = self.scale[places], self.information[:, places]
        factor = np.divide(
            scale, information, out=np.zeros_like(information), where=information > 0.0
        )
        return self.plain.sensor_bias(
            places, information / scale**2, factor, self.scale[self.plain.base.sensors]
        )

    def _simex_bias(self, places: NDArray[np.intp]) -> Array:
        """(places, flights)."""
        if self.noisy is None:
            return np.zeros((len(places), len(self.estimate)))
        again, _ = in_units(self.noisy, places, self.scale)
        return (again - self.estimate[:, places]).T
