"""Arrays of runs of different lengths."""

import numpy as np

from ffdcli.arrays import gather_runs, places_in_runs, run_numbers, run_starts


def test_runs_are_numbered_and_selected():
    entries = np.array([5, 6, 7, 8, 9])
    starts = run_starts(np.array([2, 0, 3]))
    assert starts.tolist() == [0, 2, 2, 5]
    assert run_numbers(starts).tolist() == [0, 0, 2, 2, 2]
    assert places_in_runs(np.array([2, 0, 3])).tolist() == [0, 1, 0, 1, 2]
    new, index = gather_runs(starts, np.array([2, 1, 0, 2]))
    assert new.tolist() == [0, 3, 3, 5, 8]
    assert entries[index].tolist() == [7, 8, 9, 5, 6, 7, 8, 9]


def test_no_runs():
    none = np.zeros(0, dtype=np.int64)
    assert run_starts(none).tolist() == [0]
    assert run_numbers(run_starts(none)).tolist() == []
    assert places_in_runs(none).tolist() == []
    new, index = gather_runs(np.zeros(1, dtype=np.int64), none)
    assert (new.tolist(), index.tolist()) == ([0], [])
