"""Where tests find measured flight data, and what they share."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def measured() -> Callable[[str], Path]:
    """Path of a measured data file below $AERODB_TEST_DATA (default ../shared/data beside the project); skips when absent."""
    default = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    root = Path(os.environ.get("AERODB_TEST_DATA", default))

    def find(relative: str) -> Path:
        path = root / relative
        if not path.exists():
            pytest.skip(f"measured data not here: {relative} (set AERODB_TEST_DATA)")
        return path

    return find


def pytest_addoption(parser: pytest.Parser) -> None:
    """`make campaign` runs the heavy tests with their full numbers of trials."""
    parser.addoption("--full-campaign", action="store_true", help="full numbers of trials in tests marked heavy")


@pytest.fixture(scope="session")
def trials(request: pytest.FixtureRequest) -> Callable[[int, int], int]:
    """How many seeded trials a heavy test does: `reduced` in the suite, `full` under --full-campaign."""
    full_campaign = request.config.getoption("--full-campaign")
    return lambda reduced, full: full if full_campaign else reduced
