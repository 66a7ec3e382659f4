"""Flights that several files of this folder look at."""

import pytest

from tests.support.shared_workspace import SharedWorkspaces
from tests.support.tracing_flights import read_bank


@pytest.fixture(scope="session")
def phoenix_flights(shared: SharedWorkspaces) -> None:
    """The bank of flights of `tests.support.tracing_flights`, flown once per session."""
    read_bank(shared.phoenix_flights)
