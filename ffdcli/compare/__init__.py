"""The methods that came before, small but real, to be compared with: Feng 1998, 2000 and 2002."""
