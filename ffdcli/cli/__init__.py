"""The command line `ffd`: the only place that knows click, exit codes and printing."""

from ffdcli.cli.main import main

__all__ = ["main"]
