"""A browser for the tests of reports."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a window; skips where there is none."""
    from tests.support.browser import opened  # other tests need not wait for playwright

    with opened() as chromium:
        yield chromium
