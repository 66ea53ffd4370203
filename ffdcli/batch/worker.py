"""Main function of a worker process: reads jobs from stdin, writes stages and records, as JSON.

When stdin ends, the batch has ended or was killed: the running job is abandoned and the temporary
file of its output is removed.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
from contextlib import suppress
from typing import Any


def main() -> None:
    """Run jobs until stdin ends."""
    # Messages go to a copy of stdout; other output on stdout goes to stderr.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # If memory runs out, the system kills a worker before the batch and other programs.
    with suppress(OSError), open("/proc/self/oom_score_adj", "w") as stream:
        stream.write("500")
    tasks: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    outputs: list[str] = []
    threading.Thread(target=_listen, args=(tasks, outputs), daemon=True).start()

    def answer(message: dict[str, Any]) -> None:
        answers.write(json.dumps(message) + "\n")
        answers.flush()

    while True:
        task = tasks.get()
        from ffdcli.batch.single_job import from_task, run_job

        job = from_task(task["job"])
        record = run_job(job, lambda stage: answer({"stage": stage}), epoch=task["epoch"])
        outputs.clear()
        answer({"record": record})


def _listen(tasks: queue.SimpleQueue[dict[str, Any]], outputs: list[str]) -> None:
    """Read jobs; when stdin ends, remove temporary files and end the process."""
    from ffdcli.batch.places import absolute, is_url
    from ffdcli.files import remove_remnants

    for line in sys.stdin:
        task = json.loads(line)
        job = task["job"]
        if not is_url(job["output"]):
            outputs.append(absolute(job["folder"], job["output"]))
        tasks.put(task)
    remove_remnants(list(outputs))
    os._exit(0)


if __name__ == "__main__":
    main()
