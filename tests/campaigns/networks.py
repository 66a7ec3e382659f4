"""Networks of scikit-learn beside straight lines and splines: which predicts held-out aerodynamics best?

``python -m tests.campaigns.networks`` fits four kinds of models to the same samples, predicts samples
that were left out, and prints the table; ``--write`` makes docs/reference/networks.md of it. Each kind
chooses its size (knots, neurons, local models) by cross-validation within the samples that it is fitted
to, by the same rule. A network that is used becomes a table (`as_table`) over the range of its samples.
"""

import argparse
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.coefficients import band_limited
from aerodb.effects.stall.stall_shape import StallFlight, blocked
from aerodb.estimation.splines import spline_basis
from aerodb.exchange import import_daveml
from aerodb.tables import AeroDatabase, ReferenceGeometry, Table, Term, parse
from tests.support.attas_stalls import (
    BAND,
    PUBLISHED,
    as_recorded,
    attached_database,
    attas,
    compared,
    corrected,
    empty_database,
    reconstructed,
    regressors,
    stall_flight,
    stall_window,
)
from tests.support.consistency_records import ATTAS_BIASES
from tests.support.paths import ROOT

PAGE = ROOT / "docs" / "reference" / "networks.md"
#: Parts of the cross-validation, each in one piece of the samples, so that neighbours do not help.
FOLDS = 4
#: A larger size is chosen only where it lowers the error by this share: the sizes' own scatter.
WORTH = 0.02
#: Seeds of HL-20: of the samples, and of the start of networks.
SEEDS = range(2)
#: How far beyond the range of an input, as a share of it, models are asked.
BEYOND = (0.1, 0.25, 0.5)
#: Noise of simulated coefficients over their standard deviation.
NOISE = 0.01
#: Samples that a kind is fitted to, and of those left out.
FITTED, LEFT_OUT = 300, 2000

Array = np.ndarray
Predict = Callable[[Array], Array]
Fit = Callable[[Array, Array, Any, int], Predict]


# Kinds of models


def _linear(inputs: Array, output: Array, _size: Any, _seed: int) -> Predict:
    found = np.linalg.lstsq(np.column_stack([np.ones(len(inputs)), inputs]), output, rcond=None)[0]
    return lambda x: np.asarray(found[0] + x @ found[1:])


def _splines(inputs: Array, output: Array, knots: int, _seed: int) -> Predict:
    """Cubic splines of the product. Of one or two inputs their products, of more their sum."""
    places = [np.linspace(*np.quantile(each, [0.0, 1.0]), knots) for each in inputs.T]

    def columns(x: Array) -> Array:
        bases = [
            spline_basis(values, place, "cubic") for values, place in zip(x.T, places, strict=True)
        ]
        if len(bases) > 2:
            return np.column_stack(bases)
        product = bases[0]
        for basis in bases[1:]:
            product = (product[:, :, None] * basis[:, None, :]).reshape(len(x), -1)
        return product

    found = np.linalg.lstsq(columns(inputs), output, rcond=1e-8)[0]
    return lambda x: np.asarray(columns(x) @ found)


def _feed_forward(inputs: Array, output: Array, size: tuple[int, float], seed: int) -> Predict:
    """One hidden layer of tanh, beside a straight line that it corrects."""
    from sklearn.neural_network import MLPRegressor

    neurons, decay = size
    line = _linear(inputs, output, None, seed)
    centre, width = inputs.mean(axis=0), inputs.std(axis=0)
    left = output - line(inputs)
    scale = left.std() or 1.0
    network = MLPRegressor(
        hidden_layer_sizes=(neurons,),
        activation="tanh",
        solver="lbfgs",
        alpha=decay,
        max_iter=1000,
        random_state=seed,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a search that ends at max_iter is judged by its error
        network.fit((inputs - centre) / width, left / scale)
    return lambda x: np.asarray(line(x) + scale * network.predict((x - centre) / width))


def _local_models(inputs: Array, output: Array, models: int, seed: int) -> Predict:
    """Straight lines, each valid about a centre: normalised Gaussians over k-means."""
    from sklearn.cluster import KMeans
    from sklearn.linear_model import Ridge

    centre, width = inputs.mean(axis=0), inputs.std(axis=0)
    found = KMeans(models, n_init=4, random_state=seed).fit((inputs - centre) / width)
    places = found.cluster_centers_
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e9 * np.eye(models)
    reach = apart.min(axis=1) if models > 1 else np.ones(1)

    def columns(x: Array) -> Array:
        x = (x - centre) / width
        square = np.sum((x[:, None] - places[None]) ** 2, axis=2) / reach**2
        weights = np.exp(-square + square.min(axis=1, keepdims=True))
        weights /= weights.sum(axis=1, keepdims=True)
        lines = np.column_stack([np.ones(len(x)), x])
        return np.asarray((weights[:, :, None] * lines[:, None, :]).reshape(len(x), -1))

    ridge = Ridge(1e-6, fit_intercept=False).fit(columns(inputs), output)
    return lambda x: np.asarray(ridge.predict(columns(x)))


#: Kind -> its fit, and its sizes from small to large.
KINDS: Final[Mapping[str, tuple[Fit, Sequence[Any]]]] = {
    "linear": (_linear, (None,)),
    "splines": (_splines, (2, 3, 4, 6, 8, 11, 16, 21)),
    "feed-forward": (
        _feed_forward,
        tuple((neurons, decay) for neurons in (2, 4, 8, 16) for decay in (1e-1, 1e-3)),
    ),
    "local models": (_local_models, (1, 2, 3, 5, 8, 13, 21, 34)),
}


def chosen(kind: str, inputs: Array, output: Array, seed: int = 0) -> Predict:
    """The model of a kind, its size by cross-validation: the least that no larger one beats by
    `WORTH`."""
    fit, sizes = KINDS[kind]
    if len(sizes) > 1:
        fold = np.arange(len(output)) * FOLDS // len(output)
        errors = [
            rms(
                np.concatenate(
                    [
                        fit(inputs[fold != k], output[fold != k], size, seed)(inputs[fold == k])
                        - output[fold == k]
                        for k in range(FOLDS)
                    ]
                )
            )
            for size in sizes
        ]
        enough = (1.0 + WORTH) * min(errors)
        size = next(size for size, error in zip(sizes, errors, strict=True) if error <= enough)
    else:
        size = sizes[0]
    return fit(inputs, output, size, seed)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# Cases


@dataclass(frozen=True)
class Case:
    """Samples to fit (n, k), (n,), those left out (m, k), (m,), and how far what is left counts.

    `counted` maps errors (m,) of the samples left out to those that count. `beyond` are further
    samples outside the range of those fitted: share of the range -> inputs, output.
    """

    name: str
    truth: str
    inputs: Array
    output: Array
    left_out: tuple[Array, Array]
    counted: Callable[[Array], Array]
    beyond: Mapping[float, tuple[Array, Array]]


#: Outputs of HL-20, the inputs that are moved with their ranges, what is known of the truth, and the
#: input that goes beyond its range.
HL20: Final = {
    "HL-20, CZ over alpha, Mach .6": (
        "CZ", {"alpha": (-0.1, 0.4)}, "smooth", "alpha",
    ),
    "HL-20, Cm over alpha, Mach .6": (
        "Cm", {"alpha": (-0.1, 0.4)}, "smooth", "alpha",
    ),
    "HL-20, Cl over alpha, beta": (
        "Cl", {"alpha": (-0.1, 0.4), "beta": (-0.15, 0.15)}, "smooth", "alpha",
    ),
    "HL-20, Cm over alpha, Mach": (
        "Cm", {"alpha": (-0.1, 0.4), "mach": (0.3, 4.0)}, "corners in Mach", "alpha",
    ),
    "HL-20, Cm over q, alpha 0": (
        "Cm", {"q": (-1.0, 1.0)}, "linear", "q",
    ),
    "HL-20, Cn over r, rudder": (
        "Cn", {"r": (-1.0, 1.0), "delta_rudder": (-0.3, 0.3)}, "linear", "r",
    ),
}  # fmt: skip


def hl20_cases(database: AeroDatabase, seed: int) -> Iterator[Case]:
    """HL-20's tables at random points, seen with noise; those left out without."""
    rng = np.random.default_rng([42, seed])
    rest = dict.fromkeys(database.inputs, 0.0) | {
        "V": 200.0, "alpha": 0.1, "mach": 0.6, "height_above_ground": 6000.0,
    }  # fmt: skip
    for name, (axis, ranges, truth, further) in HL20.items():
        low, high = np.array(list(ranges.values())).T

        def predicted(points: Array, axis: str = axis, ranges: Any = ranges) -> Array:
            moved = {each: points[:, k] for k, each in enumerate(ranges)}
            return np.asarray(database.predict(rest | moved).coefficients[axis])

        def drawn(n: int, low: Array = low, high: Array = high) -> Array:
            return rng.uniform(low, high, (n, len(low)))

        inputs, left_out = drawn(FITTED), drawn(LEFT_OUT)
        exact = predicted(inputs)
        beyond = {}
        for share in BEYOND:
            points, k = drawn(LEFT_OUT), list(ranges).index(further)
            points[:, k] = high[k] + share * (high[k] - low[k])
            beyond[share] = (points, predicted(points))
        seen = exact + NOISE * exact.std() * rng.standard_normal(FITTED)
        inside = (left_out >= inputs.min(axis=0)) & (left_out <= inputs.max(axis=0))
        left_out = left_out[inside.all(axis=1)]
        kept = (left_out, predicted(left_out))
        yield Case(name, truth, inputs, seen, kept, lambda errors: errors, beyond)


def attas_cases(data: Path) -> Iterator[Case]:
    """Lift of each measured stall predicted by the other, in the band and from onset to
    reattachment, as the study of ATTAS counts it; and attached rolls, by their first halves."""
    recorded = [as_recorded(data / "attas" / f"fAttas_qst0{number}.asc") for number in (1, 2)]
    result = reconstructed(recorded, ("alpha_bias", "alpha_scale"), at_boom=True)
    biases = {name: result[name].value for name in ATTAS_BIASES}
    database = attached_database(data / "attas" / "fAttasElv1.mat")
    flights = [corrected(flight, biases) for flight in recorded]
    stalls = [stall_flight(flight, database) for flight in flights]
    names = ("alpha", "q_hat", "delta_elevator")
    static = [regressors(flight, names) for flight in flights]
    lag = [
        np.column_stack([x, np.gradient(each.alpha, each.time) * each.chord / each.V])
        for x, each in zip(static, stalls, strict=True)
    ]
    for what, inputs in (("", static), (" and alphadot", lag)):
        for one, other in ((0, 1), (1, 0)):
            fitted, predicted = stalls[one], stalls[other]

            def counted(errors: Array, flight: StallFlight = predicted) -> Array:
                return np.asarray(band_limited(errors, flight.step, BAND)[stall_window(flight)])

            yield Case(
                f"ATTAS, lift of stall {other + 1} over alpha, q, elevator{what}",
                "memory",
                blocked(fitted, inputs[one]),
                blocked(fitted, fitted.residual["C_lift"]),
                (inputs[other], predicted.residual["C_lift"]),
                counted,
                {},
            )

    rolls = [as_recorded(data / "attas" / f"fAttas{name}1.mat") for name in ("Ail", "Rud")]
    rolls = [corrected(flight, PUBLISHED) for flight in rolls]
    names = ("beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder")
    for axis in ("Cl", "Cn"):
        halves: list[list[tuple[Array, Array]]] = [[], []]
        for flight in rolls:
            measured = compared(flight, empty_database()).measured[axis]
            inputs = np.column_stack([_lateral(flight, name) for name in names])
            good = np.isfinite(measured) & np.isfinite(inputs).all(axis=1)
            cut = len(measured) // 2
            for part, at in zip(halves, (slice(None, cut), slice(cut, None)), strict=True):
                part.append((inputs[at][good[at]], measured[at][good[at]]))
        fitted, left_out = (
            (np.concatenate([x for x, _ in part]), np.concatenate([y for _, y in part]))
            for part in halves
        )
        yield Case(
            f"ATTAS, {axis} of attached rolls, second halves", "nearly linear", *fitted, left_out,
            lambda errors: errors, {},
        )  # fmt: skip


def _lateral(flight: Any, name: str) -> Array:
    if name in ("p_hat", "r_hat"):
        return np.asarray(flight[name[0]] * attas().reference.span / (2.0 * flight["V"]))
    if name == "delta_aileron":
        return np.asarray(0.5 * (flight[f"{name}_right"] - flight[f"{name}_left"]))
    return np.asarray(flight[name])


# What they predict


def errors_of(case: Case, kind: str, seed: int) -> tuple[float, dict[float, float]]:
    """Rms of the error over the standard deviation of what was left out, within the range of the
    samples and beyond it."""
    predict = chosen(kind, case.inputs, case.output, seed)

    size = float(case.counted(case.left_out[1]).std())

    def error(inputs: Array, output: Array) -> float:
        return rms(case.counted(predict(inputs) - output)) / size

    beyond = {share: error(*samples) for share, samples in case.beyond.items()}
    return error(*case.left_out), beyond


def as_table(
    predict: Predict, inputs: Array, name: str, labels: Sequence[str], most: float
) -> Table:
    """A model as a table over the range of its samples (n, k): nodes are doubled until the table
    differs from the model by `most` (rms) at the samples. Outside it holds its last value, and the
    product says that a flight is there."""
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    nodes = 5
    while True:
        axes = tuple(np.linspace(*ends, nodes) for ends in zip(low, high, strict=True))
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        values = predict(grid.reshape(-1, len(labels))).reshape(grid.shape[:-1])
        table = Table(name, tuple(labels), axes, values)
        if rms(table.lookup(*inputs.T).values - predict(inputs)) <= most:
            return table
        nodes = 2 * nodes - 1


def as_database(table: Table, axis: str, reference: ReferenceGeometry) -> AeroDatabase:
    """The table as the database of one axis."""
    term = Term("network", axis, parse(f"{table.name}({', '.join(table.arguments)})"))
    return AeroDatabase("network", reference, tables={table.name: table}, terms=(term,))


def measured_in(cases: Sequence[Sequence[Case]]) -> list[dict[str, Any]]:
    """A line for each case, from its draws: kind -> errors, and beyond the range."""
    lines = []
    for draws in zip(*cases, strict=True):
        line: dict[str, Any] = {"case": draws[0].name, "truth": draws[0].truth}
        for kind in KINDS:
            found = [errors_of(case, kind, seed) for seed, case in enumerate(draws)]
            line[kind] = float(np.mean([inside for inside, _ in found]))
            for share in found[0][1]:
                line[f"{kind}, beyond {share:g}"] = float(
                    np.mean([beyond[share] for _, beyond in found])
                )
        lines.append(line)
    return lines


# The page

HEAD: Final = """# Networks beside splines and straight lines

Can networks of scikit-learn describe aerodynamics better than what `update` fits? They need no formula.

    python -m tests.campaigns.networks --write  # this page, {minutes:.0f} min of one core

- *Linear*: one slope for each input. *Splines*: cubic, those of [`update`](../method/updates.md), with 2 to 21 knots; products of two inputs, sums of more.
- *Feed-forward*: one hidden layer of 2 to 16 neurons (tanh) that corrects a straight line. *Local models*: 1 to 34 straight lines, each valid about
  a centre.
- Each chooses its size by cross-validation within the samples that it is fitted to, by one rule.
- HL-20 (NASA's tables, DAVE-ML): {fitted} samples with noise of {noise:.0%}, mean of {seeds} draws.
- ATTAS (measured): each stall is predicted from the other record, below {band:g} Hz, from onset to reattachment.

Error of samples left out [% of their standard deviation]:

"""


def page(lines: Sequence[Mapping[str, Any]], minutes: float) -> str:
    """The page as Markdown: errors within the range of the samples, verdicts, errors beyond."""
    head = HEAD.format(minutes=minutes, fitted=FITTED, noise=NOISE, seeds=len(SEEDS), band=BAND)
    rows = [f"| case | truth | {' | '.join(KINDS)} |", "|---|---|" + "---|" * len(KINDS)]
    for line in lines:
        sizes = " | ".join(f"{100.0 * line[kind]:.3g}" for kind in KINDS)
        rows.append(f"| {line['case']} | {line['truth']} | {sizes} |")
    beyond = [line for line in lines if any("beyond" in key for key in line)]
    further = [
        "| case | beyond the range by | " + " | ".join(KINDS) + " |",
        "|---|---|" + "---|" * len(KINDS),
    ]
    for line in beyond:
        for share in BEYOND:
            sizes = " | ".join(f"{100.0 * line[f'{kind}, beyond {share:g}']:.3g}" for kind in KINDS)
            further.append(f"| {line['case']} | {share:.0%} | {sizes} |")
    return (
        head
        + "\n".join(rows)
        + "\n\n"
        + "\n".join(f"- {each}" for each in verdicts(lines))
        + "\n\n## Beyond the samples\n\n"
        + "The same models, asked outside of the range of one input [% of the standard deviation within it]:\n\n"
        + "\n".join(further)
        + "\n\n"
        + LIMITS
    )


LIMITS: Final = """No column is small beyond the samples where the truth bends. So nothing that is fitted here is used there.
A network becomes a table over the range of its samples, and the product marks each prediction beyond it. `as_table` doubles the nodes until the
table differs from the network by less than the noise. `tests/campaigns/test_networks.py` writes such a table as DAVE-ML, reads it again,
and gets the network's values.

Splines and straight lines stay what `update` and `close-loop` fit: their coefficients have names, standard errors and intervals, and can be
refused one by one. A network's cannot. Stalls have memory: [Kirchhoff's flow](../studies/attas-stall.md) has it in one state, and a network needs
it as an input.
"""


def verdicts(lines: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the lines say: networks beside splines where the truth is smooth, beside straight lines
    where it is linear."""
    told = []
    for kind in ("feed-forward", "local models"):
        smooth = [line[kind] / line["splines"] for line in lines if line["truth"] == "smooth"]
        straight = [line[kind] / line["linear"] for line in lines if "linear" in line["truth"]]
        stalled = [line[kind] / line["linear"] for line in lines if line["truth"] == "memory"]
        name = kind[0].upper() + kind[1:]
        told += [
            f"{name}: {min(ratios):.2f} to {max(ratios):.2f} times the error of {of}"
            for ratios, of in (
                (smooth, "splines where the truth is smooth"),
                (straight, "straight lines where it is linear"),
                (stalled, "straight lines in stalls"),
            )
        ]
    return told


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the page")
    asked = parser.parse_args(arguments)
    started = time.process_time()
    data = Path(os.environ.get("AERODB_TEST_DATA", ROOT.parent / "shared" / "data"))
    hl20 = hl20_database(data)
    measured = list(attas_cases(data))
    lines = measured_in([list(hl20_cases(hl20, seed)) for seed in SEEDS])
    lines += measured_in([measured])
    text = page(lines, (time.process_time() - started) / 60.0)
    if asked.write:
        PAGE.write_text(text, encoding="utf-8")
    print(text)


def hl20_database(data: Path) -> AeroDatabase:
    xml = (data / "daveml" / "HL20_aero.dml").read_bytes()
    return import_daveml(xml, name="HL-20", bindings={"DLG": "90*delta_landing_gear"})


if __name__ == "__main__":
    main()
