"""Modes beside those of flights: the published tables of the Caravan, and pairs that are missing."""

import pytest

from aerodb.report import mode_table, mode_words

FIGURES = (
    ("short period", "omega"), ("short period", "zeta"), ("phugoid", "omega"), ("phugoid", "zeta"),
    ("Dutch roll", "omega"), ("Dutch roll", "zeta"), ("roll", "time_constant"),
    ("spiral", "time_constant"),
)  # fmt: skip
#: Tables 3 to 6 of "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand
#: Caravan Engineering Simulation": flight, initial model and its error [%], updated one and its.
PRINTED = {
    0: (
        (4.12, 6.63, 60.92, 4.42, 7.28),
        (0.534, 0.451, -15.54, 0.54, 1.12),
        (0.177, 0.141, -20.34, 0.187, 5.65),
        (0.0789, 0.179, 126.87, 0.0965, 22.31),
        (1.85, 3.06, 65.41, 1.85, 0.0),
        (0.18, 0.155, -13.89, 0.217, 20.56),
        (0.351, 0.220, -37.30, 0.308, -12.25),
        (35.34, 106.0, 199.98, 26.7, -24.45),
    ),
    10: (
        (3.69, 5.98, 62.06, 4.01, 8.67),
        (0.623, 0.469, -24.72, 0.628, 0.80),
        (0.154, 0.151, -1.95, 0.148, -3.90),
        (0.148, 0.168, 13.51, 0.0968, -34.59),
        (1.87, 2.91, 55.61, 1.76, -5.88),
        (0.187, 0.154, -17.65, 0.232, 24.06),
        (0.262, 0.21, -19.99, 0.267, 1.91),
        (44.74, 198.0, 342.53, 45.3, 1.25),
    ),
}
#: Printed errors that the printed values do not give to the last digit.
ROUNDED = {(0, "roll"): -37.32, (0, "spiral"): 199.94, (10, "roll"): -19.85, (10, "spiral"): 342.56}
#: What the update made worse, by these tables; the text names none of it.
WORSE = {
    0: {("Dutch roll", "zeta")},
    10: {("phugoid", "omega"), ("phugoid", "zeta"), ("Dutch roll", "zeta")},
}


def modes(column: int, flaps: int) -> list[dict]:
    found: dict[str, dict] = {}
    for (mode, figure), row in zip(FIGURES, PRINTED[flaps], strict=True):
        entry = found.setdefault(mode, {"name": mode, "figures": {}, "standard_errors": None})
        entry["figures"][figure] = row[column]
    return list(found.values())


@pytest.mark.parametrize("flaps", [0, 10])
def test_the_published_tables(flaps: int) -> None:
    rows = mode_table(modes(0, flaps), {"initial": modes(1, flaps), "updated": modes(3, flaps)})
    assert [(row["mode"], row["figure"]) for row in rows] == list(FIGURES)
    for row, printed in zip(rows, PRINTED[flaps], strict=True):
        initial = ROUNDED.get((flaps, row["mode"]), printed[2])
        assert row["errors"]["initial"] == pytest.approx(initial, abs=0.006), row
        assert initial == pytest.approx(printed[2], abs=0.15)
        assert row["errors"]["updated"] == pytest.approx(printed[4], abs=0.006), row
    assert {(row["mode"], row["figure"]) for row in rows if row["worse"]} == WORSE[flaps]
    nearer, farther = mode_words(rows)
    assert "natural frequency of the short period" in nearer
    assert farther.startswith("Farther off:")
    assert "damping ratio of the Dutch roll" in farther


def test_modes_that_one_side_lacks_are_said() -> None:
    flown, model = modes(0, 0), [mode for mode in modes(1, 0) if mode["name"] != "spiral"]
    rows = mode_table(flown, {"v0001": model})
    spiral = rows[-1]
    assert spiral["values"] == spiral["errors"] == {"v0001": None}
    assert not spiral["worse"]
    assert mode_words(rows) == ["v0001 has no spiral."]
    assert mode_table([], {"v0001": model}) == []
