"""Folders of the repository that tests read."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
SAMPLES = ROOT / "samples"
BENCHMARKS = ROOT / "benchmarks"
# Meshes that the repository does not hold; tests that read them are skipped where they are missing.
REAL_MESHES = ROOT.parent / "shared" / "meshes"
# The mesh of each sample, by the name of its lattice file.
MESHES = {
    lattice.stem: next(file for file in SAMPLES.glob(f"{lattice.stem}.*") if file != lattice)
    for lattice in sorted(SAMPLES.glob("*.yaml"))
}
