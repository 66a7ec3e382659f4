"""``aerodb flight frequency-response``: a planted short period by command, and what has no
coherence."""

from pathlib import Path

import numpy as np
import pytest

from tests.aerodb.estimation.spectra.test_frequency_response import (
    SHORT_PERIOD,
    TRUTH,
    pitch_rate,
    sweep,
)
from tests.support.command import aerodb, asked
from tests.support.equations import coloured
from tests.support.small_glider import NAME, RHO, VEHICLE, V, write_parquet


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with a sweep of the elevator, whose pitch rate has the planted response, and an
    angle of sideslip that has none."""
    folder = tmp_path_factory.mktemp("response")
    time, control = sweep(100.0)
    rng, n = np.random.default_rng(1), len(time)
    zero = np.zeros(n)
    table = {
        "time": time,
        "V": np.full(n, V),
        "qbar": np.full(n, 0.5 * RHO * V**2),
        "alpha": 0.05 + 0.2 * control,
        "beta": 0.01 * coloured(rng, n, 0.9),
        "p": zero,
        "q": pitch_rate(time, control) + 0.005 * coloured(rng, n, 0.9),
        "r": zero,
        "ax": zero,
        "ay": zero,
        "az": np.full(n, -9.8),
        "delta_elevator": control,
    }
    log = write_parquet(folder / "sweep.parquet", table)
    (folder / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    asked(
        folder / "w", "flight", "ingest", str(log), "--vehicle", NAME, "--name", "sweep", "--direct"
    )
    return folder / "w"


def _asked(root: Path, output: str, *options: str) -> dict:
    given = ("--input", "delta_elevator", "--output", output, "--zeros", "1", "--poles", "2")
    return asked(root, "flight", "frequency-response", "sweep", *given, *options)


def test_the_planted_short_period(root: Path) -> None:
    document = _asked(root, "q", "--highest", "12")
    found = {each["name"]: each for each in document["estimates"]}
    assert tuple(found) == SHORT_PERIOD.names
    for name, truth in zip(SHORT_PERIOD.names, TRUTH, strict=True):
        each = found[name]
        assert each["standing"] == "estimated"
        assert each["value"] == pytest.approx(
            truth, abs=max(0.05 * abs(truth), 4 * each["standard_error"])
        )
    used = [row for row in document["frequencies"] if row["used"]]
    assert len(used) > 40
    assert all(0.6 <= row["coherence"] <= 1.0 for row in used)
    part = _asked(root, "q", "--highest", "12", "--from", "20", "--to", "95")
    assert part["frequencies"][0]["omega"] > document["frequencies"][0]["omega"]


def test_without_coherence_and_for_people(root: Path) -> None:
    document = _asked(root, "beta", "--highest", "12")
    assert {each["standing"] for each in document["estimates"]} == {"not excited"}
    assert "coherence" in document["estimates"][0]["reason"]
    options = ("--input", "delta_elevator", "--output", "q", "--zeros", "1", "--highest", "12")
    done = aerodb(root, "flight", "frequency-response", "sweep", *options)
    assert done.returncode == 0, done.stderr
    assert "omega" in done.stdout
    assert "cost J" in done.stdout
    wrong = aerodb(root, "flight", "frequency-response", "sweep", *options, "--poles", "3")
    assert wrong.returncode == 3
    assert "factors" in wrong.stderr
