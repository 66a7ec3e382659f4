"""A browser for what notebooks show."""

from tests.flows.web.conftest import browser

__all__ = ["browser"]
