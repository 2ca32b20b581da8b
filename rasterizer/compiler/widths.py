"""How many numbers the vector instructions of intrinsics.py work on side by side."""

LANES = 8  # samples of a box that are merged
PLANE_GROUP = 4  # planes that are evaluated
