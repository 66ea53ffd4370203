"""Fixtures of the tests of editing by hand."""

import pytest

from ffdcli.editor import drawn


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Draw models with fewer vertices than on a screen."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawn, "EDGE", 1 / 12)
        yield
