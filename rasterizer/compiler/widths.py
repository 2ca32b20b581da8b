"""How many numbers the vector instructions of intrinsics.py work on side by side, and what they know of an entry."""

LANES = 8  # samples of a box that are merged
PLANE_GROUP = 4  # planes that are evaluated
ID_BIT = 24  # of a visibility entry: it holds the index of a record
TEXELS_AHEAD = 96  # samples by which texels are asked for before they are read
