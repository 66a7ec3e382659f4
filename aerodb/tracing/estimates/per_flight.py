"""Each flight's own estimate of each hypothesis, given a model.

`aerodb.tracing.estimates.campaigns` puts the flights on one order of columns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerodb.effects import Hypothesis
from aerodb.support import HALF, LARGE, SMALL, Array, Mask
from aerodb.tracing.estimates.elimination import ModelElimination, SensorElimination
from aerodb.tracing.estimates.products import Products
from aerodb.tracing.evidence import TOLERANCE

#: Largest scaled precision of a shape-misfit term.
KNOWN = 1e9

#: Where less than this part of a column's information is signal, noise may have made the whole
#: estimate.
_LEAST_SIGNAL = HALF
#: The same for an estimate against no noise. The power of the noise is known to some 20 % (one draw
#: against one flight, of some hundred samples each). With a quarter of noise the estimate errs by
#: 10 % for it, with a half by 40 %.
_LEAST_SIGNAL_EXTRAPOLATED = LARGE

#: Share of noise in a column's power. Up to it the column is noise for the greater part only where
#: others are nearly collinear with it.
_NOISY = SMALL

#: Places of accepted terms, of freed and of fixed sensors, and of the terms whose shape may be
#: wrong.
Model = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True)
class HypothesisBias:
    """Biases of one hypothesis' per-flight estimates, SI units.

    sensor_bias (flights, sensors) : what a unit error of the sensor adds in spite of its prior.
    simex_bias (flights,) : what the flight's state noise adds; 0 without.
    """

    sensor_bias: Array
    simex_bias: Array


class EstimateBiases(Protocol):
    """Biases of estimates that no residual shows; computed for hypotheses on request."""

    def at(self, indices: Sequence[int]) -> Sequence[HypothesisBias]:
        """Return the biases (flights, sensors) and (flights,) of each hypothesis, SI units."""


@dataclass(frozen=True)
class FlightEstimates:
    """Estimates (flights, hypotheses) of every hypothesis given the nuisance parameters, SI units.

    estimate : ``gamma = A_hy / A_hh``; nan where the flight says nothing. information : ``A_hh``
    after the nuisance parameters, one over the variance that whitened noise gives, 0 where the
    flight says nothing. information_before : ``H_hh``, the same with the hypothesis and the
    intercepts alone. biases : of all flights; chosen : which of them these are, in order, where
    they are not all.
    """

    estimate: Array
    information: Array
    information_before: Array
    biases: EstimateBiases
    chosen: NDArray[np.intp] | None = None

    @property
    def inflation(self) -> Array:
        """Variance inflation factor (flights, hypotheses), dimensionless: ``H_hh / A_hh`` after the
        intercepts; infinite where nothing is left."""
        return np.divide(
            self.information_before,
            self.information,
            out=np.full_like(self.information_before, np.inf),
            where=self.information > 0.0,
        )

    def rows(self, chosen: Sequence[int] | NDArray[np.intp]) -> "FlightEstimates":
        """Return the estimates of some flights, arrays (chosen, hypotheses) in SI units."""
        index = np.asarray(chosen, dtype=np.intp)
        if np.array_equal(index, np.arange(len(self.estimate))):
            return self
        return FlightEstimates(
            self.estimate[index],
            self.information[index],
            self.information_before[index],
            self.biases,
            index,
        )

    def mean_biases(self, indices: Sequence[int], included: Mask) -> tuple[Array, Array]:
        """Return sensor biases (m, sensors) and SIMEX biases (m,) of m hypotheses, means over
        flights.

        included : (flights, hypotheses) the flights over which each mean is taken. At least one
        hypothesis.

        Both are in the unit of each hypothesis, the first per unit of each sensor error.
        """
        on = np.ascontiguousarray(included[:, list(indices)].T, dtype=np.float64)
        on /= np.maximum(on.sum(axis=1, keepdims=True), 1.0)
        biases = self.biases.at(indices)
        weights = on
        if self.chosen is not None:
            weights = np.zeros((len(indices), len(biases[0].simex_bias)))
            weights[:, self.chosen] = on
        sensor_biases = np.array(
            [weight @ each.sensor_bias for weight, each in zip(weights, biases, strict=True)]
        )
        simex_biases = np.array([each.simex_bias for each in biases])
        return sensor_biases, np.einsum(
            "pg,pg->p", weights, np.where(weights > 0.0, simex_biases, 0.0)
        )


@dataclass(frozen=True)
class Campaign:
    """The products of all flights on one order of hypotheses.

    products, noisy : scaled; total (k,) : of each column with itself, over all flights, SI. scale
    (k,) : scaled parameter = parameter * scale; precision (k,) : scaled prior precision of the
    sensors, 0 elsewhere. offsets : hypotheses that are an axis' own constant; their estimates are
    the intercepts. shape_terms : column of a shape-misfit term -> index of its base, and the least
    sigma of what it varies with; earlier : index -> value of a term that the database holds
    already: its shape may be wrong too, and every model estimates it again, since what it was
    taken for is no more certain than when it was found. extrapolated : whether SIMEX biases are
    those against no state noise; else what the noise adds when it comes once more. squares (g,
    axes, k + 1) : of each hypothesis and, last, of the residual on each axis. Results are cached,
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
    squares: Array
    shape_terms: Mapping[int, tuple[int, float]] = field(default_factory=dict)
    earlier: Mapping[int, float] = field(default_factory=dict)
    extrapolated: bool = True
    cached: dict[Model, FlightEstimates] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    single: dict[tuple[int, Model], tuple[Array, Array]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @cached_property
    def own_errors(self) -> tuple[int, ...]:
        """Sensor errors that differ from flight to flight: biases, which reconstruction estimates
        for each flight."""
        return tuple(
            index
            for index in self.sensors
            if self.hypotheses[index].effect.endswith(("_bias", "qbar_offset"))
        )

    @cached_property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """Linear effects, each with every other shape of it (`Hypothesis.has_shape`)."""
        return tuple(
            (linear, shape)
            for linear, own in enumerate(self.hypotheses)
            for shape, other in enumerate(self.hypotheses)
            if shape != linear and own.has_shape(other)
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
        """Return the estimates of every hypothesis given a model.

        The model holds the `accepted` terms, their shape-misfit terms and all sensors with their
        priors; `freed` sensors have no prior, `fixed` ones are taken as right. exact : accepted
        terms whose shape is taken as right. A hypothesis that is itself a nuisance parameter is
        estimated given the others, with its own prior left out.
        """
        model = self._model(accepted, freed, fixed, exact)
        if model not in self.cached:
            prior = self._prior(model)
            solved = self._reduced.beside(prior, *model[1:3])
            estimate, information = in_units(solved, np.arange(len(self.hypotheses)), self.scale)
            noisy = None if self._noisy is None else self._noisy.beside(prior, *model[1:3])
            added = ModelBiases(solved, noisy, estimate, information, self.scale, self.extrapolated)
            self.cached[model] = FlightEstimates(
                estimate, information, self._information_before, added
            )
        return self.cached[model]

    def noise_left(self, accepted: Sequence[int], freed: Sequence[int]) -> Array | None:
        """Return the variance of the innovation (flights, hypotheses) beside a model, as a
        part of what the noise was fitted to, which is the residual with all that is in it.

        Terms that act on several axes are shared out by their squares; a hypothesis has the mean
        of its axes by its own.
        """
        at = [i for i in (*accepted, *freed) if i not in self.offsets]
        if not at:
            return None
        estimate = self.flight_estimates(accepted, freed).estimate
        size = np.nan_to_num(estimate[:, at]) * self.scale[at]
        share, matrix = np.sqrt(self._shares[:, :, at]), self.products.matrix
        cross = 2.0 * (share**2 @ (size * matrix[:, at, -1])[:, :, None])[:, :, 0]
        among = matrix[:, at][:, :, at] * size[:, :, None] * size[:, None, :]
        explained = cross - np.einsum("gat,gtu,gau->ga", share, among, share)
        whole = np.maximum(self.squares[:, :, -1], 1.0)
        variance = 1.0 - np.clip(explained, 0.0, whole - 1.0) / whole
        own = self._shares.sum(axis=1)
        return np.where(own > 0.0, np.einsum("gak,ga->gk", self._shares, variance), 1.0)

    def flight_estimate(
        self, index: int, accepted: Sequence[int], freed: Sequence[int], fixed: Sequence[int] = ()
    ) -> tuple[Array, Array]:
        """Return estimate [unit of the hypothesis] and information [1/unit²] (flights,) of one
        hypothesis alone."""
        model = self._model(accepted, freed, fixed, ())
        if model in self.cached:
            return self.cached[model].estimate[:, index], self.cached[model].information[:, index]
        if (index, model) not in self.single:
            solved = self._reduced.beside(self._prior(model), *model[1:3])
            estimate, information = in_units(solved, np.array([index]), self.scale)
            self.single[index, model] = estimate[:, 0], information[:, 0]
        return self.single[index, model]

    def _model(
        self,
        accepted: Sequence[int],
        freed: Sequence[int],
        fixed: Sequence[int],
        exact: Sequence[int],
    ) -> Model:
        terms = tuple(sorted(set(accepted) - set(self.offsets)))
        shaped = {index for index, _ in self.shape_terms.values()}
        # A shape that the model states needs no freedom: two that cancel would have too much.
        stated = {i for pair in self.shapes if set(pair) <= set(terms) for i in pair}
        loose = tuple(i for i in terms if i in shaped and i not in exact and i not in stated)
        return terms, tuple(sorted(freed)), tuple(sorted(fixed)), loose

    def _prior(self, model: Model) -> dict[int, float]:
        """Scaled prior precision of each accepted term and shape-misfit term."""
        accepted, freed, fixed, loose = model
        value = {index: size for index, size in self.earlier.items() if index not in loose}
        if loose:
            rigid = self._reduced.beside(self._prior((accepted, freed, fixed, ())), freed, fixed)
            value |= dict(zip(loose, self._sizes(rigid, np.array(loose)), strict=True))
        again = set(self.earlier) - set(self.offsets)
        return dict.fromkeys((*accepted, *again), 0.0) | self._tolerance(value)

    def _sizes(self, rigid: ModelElimination, indices: NDArray[np.intp]) -> list[float]:
        """Common value of each of the accepted terms over the flights, by their information."""
        products = rigid.at(indices)
        total, sums = (
            np.where(products.informative, each, 0.0).sum(axis=0)
            for each in (products.after, products.cross)
        )
        return (sums / np.maximum(total * self.scale[indices], 1e-300)).tolist()

    def _tolerance(self, value: Mapping[int, float]) -> dict[int, float]:
        """Column of a shape-misfit term -> its scaled prior precision, from the size of the effect
        (`value`).
        """
        precisions = {}
        for shape, (index, least) in self.shape_terms.items():
            if index not in value:
                continue
            information_before, apart = self.total[index], self.total[shape]
            spread = np.sqrt(apart / information_before) if information_before > 0.0 else 0.0
            sigma = TOLERANCE * abs(value[index]) / max(float(spread), least) * self.scale[shape]
            precisions[shape] = min(KNOWN, sigma**-2) if sigma > 0.0 else KNOWN
        return precisions

    @cached_property
    def _shares(self) -> Array:
        """Share (flights, axes, hypotheses) of each axis in the squares of a hypothesis; 0 where it
        has none."""
        squares = np.maximum(self.squares[:, :, :-1], 0.0)  # rounding leaves less than nothing
        total = squares.sum(axis=1, keepdims=True)
        return np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0)

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
    def _information_before(self) -> Array:
        """(flights, hypotheses) ``H_hh``, SI; for offsets that of their intercepts."""
        return np.asarray(
            self._reduced.information_before * self.scale[: len(self.hypotheses)] ** 2
        )


def in_units(
    solved: ModelElimination, indices: NDArray[np.intp], scale: Array
) -> tuple[Array, Array]:
    """Return Schur complements as estimate and information, both (flights, hypotheses) and in SI
    units; nan and 0 where only rounding is left.
    """
    products = solved.at(indices)
    informative, after = products.informative, products.after
    estimate = np.divide(
        products.cross,
        after * scale[indices],
        out=np.full_like(after, np.nan),
        where=informative,
    )
    return estimate, np.where(informative, after, 0.0) * scale[indices] ** 2


@dataclass(frozen=True)
class ModelBiases:
    """`EstimateBiases` of a model, computed and cached hypothesis by hypothesis.

    plain, noisy : the model, and the model with the state noise added once more; estimate,
    information : as in `FlightEstimates`; scale, extrapolated : as in the campaign.
    """

    plain: ModelElimination
    noisy: ModelElimination | None
    estimate: Array
    information: Array
    scale: Array
    extrapolated: bool
    cached: dict[int, HypothesisBias] = field(default_factory=dict, init=False)

    def at(self, indices: Sequence[int]) -> Sequence[HypothesisBias]:
        """Return the biases (flights, sensors) and (flights,) of each hypothesis, SI units."""
        new = np.array([index for index in indices if index not in self.cached], dtype=np.intp)
        if new.size:
            pairs = zip(self._sensor_bias(new), self._simex_bias(new), strict=True)
            self.cached.update(
                zip(new.tolist(), (HypothesisBias(*pair) for pair in pairs), strict=True)
            )
        return [self.cached[index] for index in indices]

    def _sensor_bias(self, indices: NDArray[np.intp]) -> Array:
        """(hypotheses, flights, sensors)."""
        scale, information = self.scale[indices], self.information[:, indices]
        factor = np.divide(
            scale, information, out=np.zeros_like(information), where=information > 0.0
        )
        return self.plain.sensor_bias(
            indices, information / scale**2, factor, self.scale[self.plain.base.sensors]
        )

    def _simex_bias(self, indices: NDArray[np.intp]) -> Array:
        """(hypotheses, flights)."""
        if self.noisy is None:
            return np.zeros((len(indices), len(self.estimate)))
        once, twice, estimate = (
            self.plain.at(indices),
            self.noisy.at(indices),
            self.estimate[:, indices],
        )
        # what a sensor's prior takes away hides noise: a column is trusted by itself as well
        before, noisy_before = (
            each.base.information_before[:, indices] for each in (self.plain, self.noisy)
        )
        least = _LEAST_SIGNAL_EXTRAPOLATED if self.extrapolated else _LEAST_SIGNAL
        signal = 2.0 * once.after - twice.after
        trusted = (
            once.informative
            & twice.informative
            & (signal > least * once.after)
            & (2.0 * before - noisy_before > least * before)
        )
        if not self.extrapolated:
            again, _ = in_units(self.noisy, indices, self.scale)
            inflated = noisy_before - before < _NOISY * before
            again = np.where(np.isfinite(again), again, 0.0)  # what says nothing has lost all
            return np.where(trusted | inflated, again - estimate, estimate).T
        without = np.divide(
            2.0 * once.cross - twice.cross,
            signal * self.scale[indices],
            out=np.zeros_like(signal),
            where=trusted,
        )
        return (estimate - without).T
