"""Small text files that several folders of tests write."""

# The corners of a box of 2 × 3 × 4.
CORNERS = """\
v 0 0 0
v 2 0 0
v 2 3 0
v 0 3 0
v 0 0 4
v 2 0 4
v 2 3 4
v 0 3 4
"""
# The box, its sides quadrangles.
CUBE = f"""{CORNERS}\
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
