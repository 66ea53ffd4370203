"""The command line, in this process and in one of its own."""

import os
import sys
import time
from unittest.mock import patch

from click.testing import CliRunner

from ffdcli.brep.occ.processes.kernel import LocalKernel
from ffdcli.cli import main

# Begins a command line whose process is that of ffd itself.
COMMAND = [sys.executable, "-c", "from ffdcli.cli import main; main()"]


class KernelHere(LocalKernel):
    """OpenCascade of this process, which takes a second to load only once for all tests."""

    number = os.getpid()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def ffd(*arguments, status=0, kernel=KernelHere):
    """Run a command in this process; its result.

    ``status`` is the exit status it must have, None any; ``kernel`` stands in for KernelProcess.
    """
    with patch("ffdcli.cli.deform.KernelProcess", kernel):
        result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    if isinstance(result.exception, Exception):
        raise result.exception
    assert status in (None, result.exit_code), result.output
    return result


def wait_until(condition, process=None):
    """Wait for a condition for as long as it takes and the process lives; its value.

    What never comes is ended by the time limit of the whole test.
    """
    while not (value := condition()):
        assert process is None or process.poll() is None, process.communicate()
        time.sleep(0.01)
    return value
