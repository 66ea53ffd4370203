"""The lattice file: its models, its text with line numbers, and the tables it names."""
