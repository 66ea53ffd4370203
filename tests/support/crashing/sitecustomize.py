"""On the path of worker processes: opening `segv.obj` or `kill.obj` ends them by that signal."""

import os
import signal
import sys

SIGNALS = {"segv.obj": signal.SIGSEGV, "kill.obj": signal.SIGKILL}


def crash(event, arguments):
    if event == "open" and isinstance(arguments[0], str):
        number = SIGNALS.get(os.path.basename(arguments[0]))
        if number is not None:
            os.kill(os.getpid(), number)


if "ffdcli.batch.worker" in sys.orig_argv:
    sys.addaudithook(crash)
