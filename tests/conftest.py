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
