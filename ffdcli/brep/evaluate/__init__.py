"""B-reps as found in files: points, distances, areas and volumes, by code of its own."""
