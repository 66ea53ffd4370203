"""The lattice file: its models and checks, its text with lines, and the tables that it names."""
