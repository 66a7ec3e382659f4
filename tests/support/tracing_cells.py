"""What can be wrong in a simulated campaign, and how often tracing says what: the cells of the
Monte Carlo validation."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aerodb.flight import Flight
from aerodb.support.arrays import Array
from aerodb.tracing.decision.findings import Traced
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.tracing.evidence.low_pass import BandLimitedFlight
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import Vehicle
from tests.support.tracing_flights import (
    DEGREE,
    FLOOR,
    Bank,
    Cell,
    Instruments,
    coloured,
    evidence_in,
    flown,
    flown_finely,
    library,
    through_the_chain,
    vehicle,
)

#: Edge of the band in these campaigns, Hz.
SETTINGS = TracingSettings(bandwidth=1.5)


def reads(**channels: Callable[[Array, np.random.Generator], Array]) -> Instruments:
    """Instruments that show something else on these channels."""
    return lambda flight, generator: flight.with_channels(
        {n: change(flight[n], generator) for n, change in channels.items()}
    )


def _elevators_scaled(flight: Flight, _: np.random.Generator) -> Flight:
    names = ("elevon_inboard_right", "elevon_inboard_left", "elevator_inboard", "aileron_inboard")
    return flight.with_channels({f"delta_{name}": 1.05 * flight[f"delta_{name}"] for name in names})


def _other_mass(factor: float = 1.0, forward: float = 0.0) -> Vehicle:
    mass = vehicle().mass
    cg = np.asarray(mass.cg, dtype=np.float64) + np.array([forward, 0.0, 0.0])
    changed = mass.model_copy(
        update={"mass": float(np.asarray(mass.mass)) * factor, "cg": tuple(cg.tolist())}
    )
    return vehicle().model_copy(update={"mass": changed})


_WHITE = reads(alpha=lambda a, rng: a + 0.3 * DEGREE * rng.standard_normal(len(a)))
_COLOURED = reads(alpha=lambda a, rng: a + 0.3 * DEGREE * coloured(rng, len(a), 0.5))

NOTHING = Cell("nothing missing")
ONLY_A_SENSOR: tuple[Cell, ...] = (
    Cell("qbar -5 %", instruments=reads(qbar=lambda q, _: 0.95 * q)),
    Cell("alpha +.5 deg", instruments=reads(alpha=lambda a, _: a + 0.5 * DEGREE)),
    Cell("alpha noise .3 deg, white and known", instruments=_WHITE, noisy=_WHITE),
    Cell("alpha noise .3 deg, coloured and known", instruments=_COLOURED, noisy=_COLOURED),
    Cell("ax +.15 m/s2", instruments=reads(ax_imu=lambda a, _: a + 0.15)),
    Cell("ay +.1 m/s2", instruments=reads(ay_imu=lambda a, _: a + 0.1)),
    Cell("az +.2 m/s2", instruments=reads(az_imu=lambda a, _: a + 0.2)),
    Cell("CG 2 cm", assumed=_other_mass(forward=0.02)),
    Cell("mass 2 %", assumed=_other_mass(factor=1.02)),
    Cell("elevator scale 5 %", instruments=_elevators_scaled),
    Cell("alpha scale 5 %", instruments=reads(alpha=lambda a, _: 1.05 * a)),
)


def coupled(correlation: float) -> Callable[[Flight], Flight]:
    """A flight whose body flap moves with its speed brake at this correlation."""

    def reshaped(flight: Flight) -> Flight:
        brake, flap = flight["delta_speed_brake"], flight["delta_body_flap"]
        along = (brake - brake.mean()) / brake.std()
        apart = flap - flap.mean() - along * ((along @ (flap - flap.mean())) / len(flap))
        mixed = correlation * along + np.sqrt(1.0 - correlation**2) * apart / apart.std()
        return flight.with_channels({"delta_body_flap": flap.mean() + flap.std() * mixed})

    return reshaped


@dataclass
class Tally:
    """How often what came out of the campaigns of one cell, against what was planted (hypothesis id
    -> value).

    also : hypotheses that say the same of it, or a part of it.
    """

    name: str
    planted: Mapping[str, float] = field(default_factory=dict)
    also: frozenset[str] = frozenset()
    campaigns: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    covered: list[bool] = field(default_factory=list)

    def add(self, result: Traced) -> None:
        """Counts one campaign."""
        truth, self.campaigns = set(self.planted), self.campaigns + 1
        single = result.named("confirmed")
        claims = result.named("confirmed", "alias_group", "suspected")
        self.counts["false confirmed"] += any(f.hypothesis not in truth | self.also for f in single)
        self.counts["false claim"] += any(
            not (truth | self.also) & set(f.explanation_set) for f in claims
        )
        self.counts["sensor"] += bool(result.named("sensor", "ambiguous_sensor"))
        if not truth:
            return
        sets = [set(f.explanation_set) for f in result.findings]
        named = {f.hypothesis: f for f in result.findings}
        in_set = all(any({name, *self.also} & s for s in sets) for name in truth)
        self.counts["found"] += in_set or len(result.findings) >= len(truth)
        self.counts["named"] += all(name in named for name in truth)
        self.counts["in set"] += in_set
        self.counts["confirmed"] += all(
            name in named and named[name].verdict == "confirmed" for name in truth
        )
        self.counts["alias"] += any(
            f.verdict == "alias_group" and truth & set(f.explanation_set) for f in result.findings
        )
        self.counts["ambiguous"] += any(
            f.verdict == "ambiguous_sensor" and truth & set(f.explanation_set)
            for f in result.findings
        )
        for name, value in self.planted.items():
            if name in named:
                low, high = named[name].ci95
                self.covered.append(low <= value <= high)

    def join(self, other: "Tally") -> None:
        """Counts another tally's campaigns here too."""
        self.campaigns += other.campaigns
        self.counts += other.counts
        self.covered += other.covered

    def share(self, what: str) -> float:
        """Part of the campaigns."""
        return self.counts[what] / max(1, self.campaigns)

    @property
    def coverage(self) -> float:
        """Part of the intervals that hold the truth; nan without any."""
        return float(np.mean(self.covered)) if self.covered else float("nan")

    def row(self) -> str:
        """One line of the table."""
        names = (
            ("found", "named", "in set", "confirmed", "alias", "ambiguous")
            if self.planted
            else ("sensor",)
        )
        parts = [f"{name} {self.share(name):.2f}" for name in names]
        parts += [f"{name} {self.counts[name]}" for name in ("false confirmed", "false claim")]
        parts += [f"coverage {self.coverage:.2f}"] if self.planted else []
        return f"{self.name:52s} n = {self.campaigns:4d}  {'  '.join(parts)}"


def campaigns(
    bank: Bank,
    flights: int,
    trials: int,
    seed: int,
    planted: Mapping[str, float] | None = None,
    overconfident: float = 1.0,
) -> list[Traced]:
    """`trials` campaigns of `flights` flights each, drawn from a bank."""
    hypotheses = library(overconfident)
    drawn = (
        bank.draw(flights, np.random.default_rng([seed, number, flights]), planted)
        for number in range(trials)
    )
    return [trace(normal_equations, hypotheses, SETTINGS) for normal_equations in drawn]


def tally(
    name: str,
    results: Sequence[Traced],
    planted: Mapping[str, float] | None = None,
    also: frozenset[str] = frozenset(),
) -> Tally:
    """The tally of these campaigns."""
    found = Tally(name, planted or {}, also)
    for result in results:
        found.add(result)
    return found


def wrongly_singled_out(results: Sequence[Traced], truth: str) -> float:
    """Part of the campaigns in which another hypothesis is confirmed in its place."""
    return float(
        np.mean(
            [any(f.hypothesis != truth for f in result.named("confirmed")) for result in results]
        )
    )


def excess_left(bank: Bank, result: Traced, planted: Mapping[str, float]) -> float:
    """Excess rms after the update over that before, on two flights of the bank that the campaign
    did not use; the worse one.

    The bank has no residual noise, so that excess is what of the effect is left; axes are weighted
    by their floors.
    """
    values = {f.hypothesis: f.value for f in result.named("confirmed")}
    unused = [n for n, flight in enumerate(bank.flights) if flight.id not in result.flights][:2]
    return max(_excess(bank.band(number), planted, values) for number in unused)


def _excess(
    band: BandLimitedFlight, planted: Mapping[str, float], values: Mapping[str, float]
) -> float:
    before = after = 0.0
    for axis, (record,) in band.records.items():
        effect, added = np.zeros(len(record)), np.zeros(len(record))
        for total, terms in ((effect, planted), (added, values)):
            for name, value in terms.items():
                total += value * record[:, band.names.index(name) + 1]
        before += float(np.mean(np.square(effect))) / FLOOR[axis] ** 2
        after += float(np.mean(np.square(effect - added))) / FLOOR[axis] ** 2
    return float(np.sqrt(after / before))


def over_alpha(flight: Flight, column: Array) -> Array:
    """What an effect's shape goes wrong with."""
    return flight["alpha"]


def over_its_size(flight: Flight, column: Array) -> Array:
    """Likewise: an effect that grows more, or less, than in proportion."""
    return np.abs(column)


def misshapen(
    bank: Bank,
    planted: Mapping[str, float],
    error: float,
    flights: int,
    along: Callable[[Flight, Array], Array] = over_alpha,
) -> Bank:
    """A bank with an effect that varies with alpha, or what `along` gives, by `error` of itself
    over one sigma of it."""
    wrong = Bank(bank.cell, bank.flights[:flights], bank.hypotheses, bank.settings)
    for number, flight in enumerate(wrong.flights):
        evidence = evidence_in(bank.cell, flight, bank.hypotheses, number)
        residual = dict(evidence.residual)
        for name, value in planted.items():
            for axis, column in evidence.columns[name].items():
                with_ = along(flight, column)
                shape = 1.0 + error * (with_ - with_.mean()) / max(float(with_.std()), 1e-9)
                residual[axis] = residual[axis] + value * shape * column
        wrong.keep(number, replace(evidence, residual=residual))
    return wrong


def answering(gain: float, instruments: bool, trials: int) -> list[Traced]:
    """Campaigns without a defect in which the pitch rate holds `gain` of its own spread in answer
    to the noise of Cm.

    instruments : what the rate would make without that answer is given as instruments: the best
    that commands can do.
    """
    found = []
    for number in range(trials):
        generator = np.random.default_rng([10, number])
        chosen = generator.choice(len(flown()), 6, replace=False)
        normal_equations = [
            normal_equations_of(_answered(flown()[int(n)], gain, instruments, generator), SETTINGS)
            for n in chosen
        ]
        found.append(trace(normal_equations, library(), SETTINGS))
    return found


def _answered(
    flight: Flight, gain: float, instruments: bool, generator: np.random.Generator
) -> Evidence:
    noise = {axis: coloured(generator, len(flight.time)) for axis in FLOOR}
    answer = flight["q"] + gain * flight["q"].std() * noise["Cm"]
    seen = evidence_in(NOTHING, flight.with_channels({"q": answer}), library(), 0)
    given: Mapping[str, Mapping[str, Array]] = {}
    if instruments:
        without = evidence_in(NOTHING, flight, library(), 0).columns
        given = {
            name: without[name]
            for name, columns in seen.columns.items()
            if any(
                not np.array_equal(column, without[name][axis]) for axis, column in columns.items()
            )
        }
    return replace(
        seen,
        residual={axis: FLOOR[axis] * values for axis, values in noise.items()},
        instruments=given,
    )


def chain(planted: Mapping[str, float], trials: int) -> list[Traced]:
    """Campaigns of six flights through the product's chain from sensors to coefficients."""
    found = []
    for number in range(trials):
        generator = np.random.default_rng([12, number])
        chosen = generator.choice(len(flown_finely()), 6, replace=False)
        finely = [flown_finely()[int(n)] for n in chosen]
        flights = [
            through_the_chain(flight, generator, library(), planted, SETTINGS.bandwidth)
            for flight in finely
        ]
        found.append(
            trace(
                [normal_equations_of(flight, SETTINGS) for flight in flights], library(), SETTINGS
            )
        )
    return found
