"""`ffd edit` on the command line: help and errors; its page has tests of its own."""

from __future__ import annotations

import subprocess
import sys
from unittest.mock import patch

from support.commands import ffd
from support.places import SAMPLES


def test_help_needs_no_browser_library():
    code = "import sys; from ffdcli.cli import main; import ffdcli.cli.edit; " \
        "print([name for name in ('viser', 'numpy', 'OCP') if name in sys.modules])"  # fmt: skip
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
    assert "--no-open" in ffd("edit", "--help").output


def test_without_viser_a_sentence_says_what_to_install():
    with patch("ffdcli.cli.edit.find_spec", lambda name: None):
        result = ffd("edit", SAMPLES / "bracket.obj", status=1)
    assert result.output.splitlines() == [
        "error: `ffd edit` needs the package viser (pip install 'ffdcli[edit]')"
    ]


def test_a_model_that_is_missing_is_refused(tmp_path):
    result = ffd("edit", tmp_path / "none.stl", "--no-open", status=1)
    assert "there is no such file" in result.output
    assert list(tmp_path.iterdir()) == []
