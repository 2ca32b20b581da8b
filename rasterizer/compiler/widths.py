"""How many numbers the vector instructions of intrinsics.py work on side by side."""

LANES = 8  # samples of a box that are merged
PLANE_GROUP = 4  # planes that are evaluated
TEXELS_AHEAD = 32  # samples by which texels are asked for before they are read
