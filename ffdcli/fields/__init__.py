"""Fields of displacements from files: tables, arrays and results of finite elements."""
