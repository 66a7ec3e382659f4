"""Networks beside splines and straight lines: a planted smooth and a planted straight truth, a network as a table of a
database, and the page of the campaign."""

import numpy as np
import pytest

pytest.importorskip("sklearn")

from aerodb.exchange import export_daveml, import_daveml
from aerodb.tables import ReferenceGeometry
from tests.campaigns.networks import (
    KINDS,
    PAGE,
    Case,
    as_database,
    as_table,
    chosen,
    errors_of,
    verdicts,
)

NOISE = 0.01


def _case(truth, seed: int = 1, n: int = 150) -> Case:
    rng = np.random.default_rng(seed)
    inputs, left_out = rng.uniform(-1.0, 1.0, (n, 1)), rng.uniform(-0.95, 0.95, (500, 1))
    exact = truth(inputs[:, 0])
    seen = exact + NOISE * exact.std() * rng.standard_normal(n)
    return Case("planted", "", inputs, seen, (left_out, truth(left_out[:, 0])), lambda e: e, {})


@pytest.mark.parametrize("network", ["feed-forward", "local models"])
def test_no_better_than_a_line_on_a_line_and_no_worse_than_splines_on_a_curve(network: str) -> None:
    """Errors over the standard deviation: a line to a third of the noise, a curve to as much."""
    line, curve = _case(lambda x: 0.3 - 2.0 * x), _case(lambda x: np.sin(3.0 * x) + 0.5 * x)
    error = {kind: errors_of(line, kind, 0)[0] for kind in ("linear", network)}
    assert error["linear"] < 0.3 * NOISE
    assert 0.95 * error["linear"] < error[network] < NOISE
    error = {kind: errors_of(curve, kind, 0)[0] for kind in ("linear", "splines", network)}
    assert error["linear"] > 0.2
    assert max(error["splines"], error[network]) < 1.5 * NOISE


def test_what_a_network_has_no_samples_of_it_does_not_know() -> None:
    """Half a range beyond the samples every kind is far off a curve; noise is all that is there of nothing."""
    curve = _case(lambda x: np.sin(3.0 * x))
    beyond = np.linspace(1.5, 2.0, 50)[:, None]
    for kind in KINDS:
        error = chosen(kind, curve.inputs, curve.output)(beyond) - np.sin(3.0 * beyond[:, 0])
        assert np.sqrt(np.mean(error**2)) > 20.0 * NOISE, kind


def test_a_network_becomes_a_table_that_daveml_keeps() -> None:
    """Within the table's own tolerance of the network inside; outside the product says so."""
    rng = np.random.default_rng(4)
    inputs = rng.uniform([-0.1, -0.2], [0.3, 0.2], (200, 2))
    output = np.sin(6.0 * inputs[:, 0]) * (1.0 + inputs[:, 1])
    predict = chosen("local models", inputs, output)
    table = as_table(predict, inputs, "lift", ("alpha", "beta"), 1e-3)
    database = as_database(table, "CZ", ReferenceGeometry(10.0, 1.0, 10.0, (0.0, 0.0, 0.0)))
    again = import_daveml(export_daveml(database), name="again")
    channels = {"alpha": inputs[:, 0], "beta": inputs[:, 1]}
    found = again.predict(channels).coefficients["CZ"]
    assert np.sqrt(np.mean((found - predict(inputs)) ** 2)) < 1e-3
    assert table.lookup(np.array([0.2, 0.31]), np.array([0.0, 0.0])).outside.tolist() == [
        False,
        True,
    ]


def test_the_page_says_what_its_table_says() -> None:
    lines = []
    for row in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if len(cells) == 2 + len(KINDS) and cells[1] in (
            "smooth",
            "linear",
            "memory",
            "nearly linear",
            "corners in Mach",
        ):
            values = dict(zip(KINDS, map(float, cells[2:]), strict=True))
            lines.append({"case": cells[0], "truth": cells[1], **values})
    assert len(lines) >= 10
    for sentence in verdicts(lines):  # within what three digits round
        name, _, rest = sentence.partition(":")
        assert any(
            each.startswith(f"- {name}: {rest[1:4]}")
            for each in PAGE.read_text("utf-8").splitlines()
        )
