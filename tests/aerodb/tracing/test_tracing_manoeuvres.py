"""Few units beside the linear set: a planted effect is suspected with its size; with nothing
missing, hardly anything is."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.effects.hypothesis import Hypothesis
from aerodb.tracing.decision.few_flights import accompanying_linear_terms, few_flight_findings
from aerodb.tracing.estimates.significance import by_families
from aerodb.tracing.evidence.evidence import Evidence, halves
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_cells import ONLY_A_SENSOR
from tests.support.tracing_flights import FLOOR, Cell, coloured, evidence_in, flown, library

pytestmark = pytest.mark.usefixtures("phoenix_flights")

SETTINGS = TracingSettings(bandwidth=1.0)
PLANTED = "sideslip_coupling@Cn"


@pytest.fixture(scope="module")
def hypotheses() -> tuple[Hypothesis, ...]:
    return library()


def drawn(cell: Cell, hypotheses: tuple[Hypothesis, ...], seed: int, count: int) -> list[Evidence]:
    """Some flights of a cell with a coloured residual of its own each."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(flown()), size=count, replace=False)
    clean = [evidence_in(cell, flown()[k], hypotheses, int(k)) for k in chosen]
    return [
        _loud(replace(each, flight=f"flight {k}"), rng)
        for k, each in zip(chosen, clean, strict=True)
    ]


def _loud(clean: Evidence, rng: np.random.Generator) -> Evidence:
    """With a coloured residual besides, the same in the copies with more state noise."""
    added = {
        axis: FLOOR[axis] * coloured(rng, len(values)) for axis, values in clean.residual.items()
    }
    copies = (clean, *clean.noisy)
    loud = [
        replace(e, residual={axis: values + added[axis] for axis, values in e.residual.items()})
        for e in copies
    ]
    return replace(loud[0], noisy=tuple(loud[1:]))


@pytest.mark.parametrize("count", [2, 3])
def test_a_planted_effect_is_suspected_with_its_size(
    hypotheses: tuple[Hypothesis, ...], count: int
) -> None:
    """Large for its noise: two units must do."""
    cell = Cell("planted", effects={PLANTED: -4.0})
    said = few_flight_findings(drawn(cell, hypotheses, 1, count), hypotheses, SETTINGS)
    found = {finding.hypothesis: finding for finding in said.findings}
    assert PLANTED in found
    finding = found[PLANTED]
    assert finding.verdict in ("suspected", "ambiguous_sensor")
    assert finding.ci95[0] < -4.0 < finding.ci95[1]
    assert -4.6 < finding.value < -3.4
    beside = {each.hypothesis for each in accompanying_linear_terms(said.joint, [finding])}
    assert "beta_slope@Cn" in beside
    assert all("Cn" in each.axis for each in accompanying_linear_terms(said.joint, [finding]))


ALONE = "control_effectiveness@Cn:rudder"


@pytest.mark.parametrize("borne_out", [True, False])
def test_one_manoeuvre_alone_is_believed_when_the_others_bear_it_out(
    hypotheses: tuple[Hypothesis, ...], borne_out: bool
) -> None:
    """The rudder moves in the first unit and a fifth as much in the others, too little for a vote:
    with the same effect in them it is suspected, with the opposite it is not."""
    units = []
    for number, each in enumerate(drawn(Cell("one"), hypotheses, 3, 4)):
        share, effect = (1.0, 0.2) if number == 0 else (0.2, 0.2 if borne_out else -0.2)
        column = {axis: share * values for axis, values in each.columns[ALONE].items()}
        residual = {
            axis: values + effect * column.get(axis, 0.0) for axis, values in each.residual.items()
        }
        units.append(replace(each, columns={**each.columns, ALONE: column}, residual=residual))
    found = {
        finding.hypothesis: finding
        for finding in few_flight_findings(units, hypotheses, SETTINGS).findings
    }
    assert (ALONE in found) == borne_out
    if borne_out:
        assert len(found[ALONE].votes) == 1
        assert found[ALONE].ci95[0] < 0.2 < found[ALONE].ci95[1]


@pytest.mark.parametrize("lasts", [1.0, 0.5])
def test_where_the_others_say_nothing_the_halves_of_the_one_manoeuvre_must_agree(
    hypotheses: tuple[Hypothesis, ...], lasts: float
) -> None:
    """The rudder moves in the first unit only. An effect in all of it is suspected; one in its
    first half, twice as large, not: what is claimed of one manoeuvre must hold in both parts of
    it."""
    units = []
    for number, each in enumerate(drawn(Cell("one"), hypotheses, 5, 4)):
        column = {
            axis: (1.0 if number == 0 else 0.03) * values
            for axis, values in each.columns[ALONE].items()
        }
        shown = np.cumsum(np.square(column["Cn"] - column["Cn"].mean()))
        there = np.where(shown <= lasts * shown[-1], 0.1 / lasts, 0.0)
        residual = {
            axis: values + there * column.get(axis, 0.0) for axis, values in each.residual.items()
        }
        units.append(replace(each, columns={**each.columns, ALONE: column}, residual=residual))
    found = {
        finding.hypothesis: finding
        for finding in few_flight_findings(units, hypotheses, SETTINGS).findings
    }
    assert (ALONE in found) == (lasts == 1.0)
    if ALONE in found:
        assert len(found[ALONE].votes) == 1
        assert found[ALONE].ci95[0] < 0.1 < found[ALONE].ci95[1]


def test_noise_of_the_states_is_no_effect(hypotheses: tuple[Hypothesis, ...]) -> None:
    """.3 deg of white noise on alpha, two flights: without the copies that show what it does to
    estimates, effects are suspected; with them none is."""
    (cell,) = (cell for cell in ONLY_A_SENSOR if cell.name == "alpha noise .3 deg, white and known")
    for seed in (3000, 3001):
        units = drawn(cell, hypotheses, seed, 2)
        assert few_flight_findings(
            [replace(each, noisy=()) for each in units], hypotheses, SETTINGS
        ).findings
        assert few_flight_findings(units, hypotheses, SETTINGS).findings == ()


def test_halves_show_the_same_and_stand_apart() -> None:
    """A pulse from 4 to 8 s of 20: cut in its middle, each half 2.5 correlation times from it."""
    time = np.arange(0.0, 20.02, 0.04)
    pulse = np.where((time >= 4.0) & (time < 8.0), np.where(time < 6.0, 1.0, -1.0), 0.0)
    usable = {"Cn": np.ones(len(time), dtype=bool)}
    unit = Evidence("f", 0.04, {"Cn": np.zeros(len(time))}, usable, {"x": {"Cn": pulse}})
    first, second = halves(unit, "x", {"Cn": 1.0}, 0.4)
    assert first.flight == "f@0-4.96"
    assert second.samples == len(time) - round(6.96 / 0.04)
    assert halves(unit, "x", {"Cn": 1.0}, 3.0) == ()
    assert halves(unit, "another", {"Cn": 1.0}, 0.1) == ()


def test_only_what_can_be_claimed_shares_the_level() -> None:
    """Two families, one half of the level each; false claims of independent true nulls stay at the
    level: 4,000 draws, one standard error .35 %."""
    p = np.array([0.001, 0.2, 0.004, 1e-9])
    assert by_families(p, [[0, 1], [2]]).tolist() == [0.004, 0.4, 0.008, 1.0]
    rng = np.random.default_rng(1)
    draws = rng.random((4000, 40))
    claimed = [(by_families(row, [range(10), range(10, 30)]) < 0.05).any() for row in draws]
    assert 0.035 < np.mean(claimed) < 0.061


@pytest.mark.campaign
@pytest.mark.parametrize("count", [2, 3])
def test_with_nothing_missing_hardly_anything_is_suspected(
    hypotheses: tuple[Hypothesis, ...], count: int
) -> None:
    """At most one campaign in ten: nothing of this enters a database by itself."""
    wrong = sum(
        bool(
            few_flight_findings(
                drawn(Cell("empty"), hypotheses, seed, count), hypotheses, SETTINGS
            ).findings
        )
        for seed in range(100)
    )
    assert wrong <= 10
