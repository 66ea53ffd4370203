"""Fixtures of the tests of the page."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Nothing: `ffd edit` runs in its own process, and draws as many vertices as on a screen."""
