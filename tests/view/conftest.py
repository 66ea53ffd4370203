"""Where pictures of tests are kept, so that people can look at them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def artefacts(tmp_path_factory) -> Path:
    """The folder that FFD_ARTEFACTS names, or a temporary one."""
    named = os.environ.get("FFD_ARTEFACTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("artefacts")
    folder.mkdir(parents=True, exist_ok=True)
    return folder
