"""Fixtures of all tests."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings

from support.jobs import read_job

# The same examples on every run, however long they take. Others are tried by
# `python -m pytest --hypothesis-profile=random`.
settings.register_profile("random", deadline=None)
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


def pytest_configure():
    """Answer Ctrl-C, and let the processes of tests answer it, in a run begun in the background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def artefacts(tmp_path_factory) -> Path:
    """The folder that FFD_ARTEFACTS names, or a temporary one."""
    named = os.environ.get("FFD_ARTEFACTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("artefacts")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def job(tmp_path):
    """Write a mesh and a lattice file and read them back; see :func:`support.jobs.read_job`."""
    return partial(read_job, tmp_path)
