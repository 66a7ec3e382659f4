"""Databases drawn at random for property tests: tables, variables, factors, wind axes, increments,
declared uncertainty."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import Expression, parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty

RANGES = {
    "alpha": (-0.2, 0.5),
    "beta": (-0.3, 0.3),
    "delta_elevator": (-0.4, 0.3),
    "mach": (0.1, 0.8),
}
REGRESSORS = {
    "alpha": ("alpha", "min(alpha, 0.125)", "max(alpha - 0.125, 0)", "clip(alpha - 0.05, 0, 0.1)"),
    "beta": ("beta", "abs(beta)", "-2*abs(beta + 0.01)"),
    "delta_elevator": ("delta_elevator", "delta_elevator/2"),
    "mach": ("mach", "1 - mach"),
}


def generated(seed: int, increments: int = 2, uncertain: bool = True) -> AeroDatabase:
    """A database of random numbers; equal seeds give equal databases."""
    rng = np.random.default_rng(seed)
    tables, terms = {}, []
    for k in range(int(rng.integers(2, 5))):
        over = sorted(
            rng.choice(list(RANGES), size=int(rng.integers(1, 4)), replace=False).tolist()
        )
        name = f"T{k}"
        tables[name] = _table(
            name, over, rng, _uncertainty(rng) if uncertain and rng.random() < 0.4 else None
        )
        called = f"{name}({', '.join(str(rng.choice(['angle', 'alpha', '2*angle - 0.1'])) if x == 'alpha' else x for x in over)})"
        factor = str(rng.choice(["", "", "-2*", "abs(beta)*", "scale*", "c_ref/b_ref*"]))
        axis = str(rng.choice(["CX", "CZ", "Cm", "Cn", "C_lift", "C_drag"]))
        terms.append(Term(f"term {k}", axis, parse(f"{factor}{called}"), 'über 1, "2"\nlines'))
    terms.append(Term("damping", "Cm", parse("-3.5*q_hat + 0.1*free")))
    scattered = {}
    if rng.random() < 0.3:
        spread = Uncertainty("absolute", "normal", ("scale",)) if uncertain else None
        scattered["S"] = ScatteredTable(
            "S", ("alpha", "mach"), rng.uniform(-0.2, 0.8, (7, 2)), rng.normal(size=7), spread
        )
        terms.append(Term("scattered", "CX", parse("S(alpha, mach)")))
    spread = Uncertainty("additive", "uniform", (0.1, 0.2)) if uncertain else None
    variables = {
        "angle": Variable(parse("alpha"), "rad"),
        "scale": Variable(parse("1.25"), "1", "a factor", uncertainty=spread),
    }
    identified = tuple(
        _increment(str(rng.choice([term.axis for term in terms])), rng) for _ in range(increments)
    )
    reference = ReferenceGeometry(
        *rng.uniform(1.0, 20.0, 3).tolist(), tuple(rng.normal(size=3).tolist())
    )
    return AeroDatabase(
        f"generated {seed}",
        reference,
        variables,
        tables,
        tuple(terms),
        identified,
        {"free": "a number"},
        "é",
        "seeded",
        scattered,
    )


def points(database: AeroDatabase, seed: int, n: int = 200) -> dict[str, np.ndarray]:
    """Channels (n,) inside and outside of tables and envelopes, some of them exactly on breakpoints
    and corners."""
    rng = np.random.default_rng(seed)
    channels = {name: rng.uniform(-1.5, 1.5, n) for name in database.inputs}
    channels["V"] = rng.uniform(20.0, 90.0, n)
    for name, (low, high) in RANGES.items():
        channels[name] = rng.uniform(low - 1.0, high + 1.0, n)
        corners = [
            x for i in database.increments if name in i.envelope for x in _corners(i.envelope[name])
        ]
        for table in database.tables.values():
            corners += [
                x
                for label, axis in zip(table.arguments, table.breakpoints, strict=True)
                if label == name
                for x in axis
            ]
        on = rng.random(n) < 0.3
        channels[name][on] = rng.choice(corners or [0.0], int(on.sum()))
    return channels


def equal(one: Any, other: Any) -> bool:
    """Whether two values are the same to the last bit, through dataclasses, mappings, sequences and
    arrays."""
    if isinstance(one, Expression):
        return bool(one == other)
    if is_dataclass(one):
        names = [
            field.name for field in fields(one) if field.compare and not field.name.startswith("_")
        ]
        return type(one) is type(other) and all(
            equal(getattr(one, name), getattr(other, name)) for name in names
        )
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(
            equal(value, other[key]) for key, value in one.items()
        )
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and one.tobytes() == other.tobytes()
    return bool(one == other)


def _corners(interval: Interval) -> list[float]:
    low, high, cell = interval.low, interval.high, interval.cell
    return [low - 2 * cell, low - cell, low, high, high + cell, high + 2 * cell]


def _table(
    name: str, over: list[str], rng: np.random.Generator, uncertainty: Uncertainty | None
) -> Table:
    axes = tuple(np.unique(rng.uniform(*RANGES[x], size=int(rng.integers(1, 5)))) for x in over)
    ways = tuple(rng.choice(["linear", "floor"], len(over)).tolist()) if rng.random() < 0.15 else ()
    beyond = ("max",) * len(over) if not ways and rng.random() < 0.1 else ()
    return Table(
        name,
        tuple(over),
        axes,
        rng.normal(size=[axis.size for axis in axes]),
        ways,
        beyond,
        uncertainty,
    )


def _uncertainty(rng: np.random.Generator) -> Uncertainty:
    if rng.random() < 0.5:
        return Uncertainty("percentage", "normal", (float(rng.uniform(5, 30)),), sigmas=3.0)
    return Uncertainty("additive", "uniform", (float(rng.uniform(0.01, 0.3)),))


def _increment(axis: str, rng: np.random.Generator) -> Increment:
    over = sorted(rng.choice(list(REGRESSORS), size=2, replace=False).tolist())
    texts = [
        "1",
        *[str(rng.choice(REGRESSORS[name])) for name in over],
        f"{over[0]}*{over[1]}",
        "q_hat",
    ]
    envelope = {}
    for name in {*over, "alpha", "beta", "q_hat"}:
        low, high = np.sort(rng.uniform(*RANGES.get(name, (-0.1, 0.1)), 2)).tolist()
        envelope[name] = Interval(low, high, float(rng.uniform(0.02, 0.3)))
    root = rng.normal(size=(len(texts), len(texts)))
    flights = tuple(f"flight-{k}" for k in range(int(rng.integers(0, 4))))
    return Increment(
        axis,
        tuple(map(parse, texts)),
        rng.normal(size=len(texts)),
        root @ root.T,
        envelope,
        flights,
        "note, é",
    )
