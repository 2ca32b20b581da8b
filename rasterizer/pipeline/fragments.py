"""The rows that lighting works on: up to CHUNK surface points at a time, one quantity a row, in the L1 cache.

All rows stand one behind the other in one flat array, `rows[NORMAL_X + k]`: with offsets that are known when it is
compiled, the compiler sees that rows don't overlap, and vectorises. Directions are unit vectors and point away from the
surface; positions are relative to the eye, so that float32 keeps its digits far from the origin; all axes are the
world's.
"""

import numpy as np

CHUNK = 256

NORMAL_X, NORMAL_Y, NORMAL_Z = (np.uint64(CHUNK * k) for k in range(3))
POSITION_X, POSITION_Y, POSITION_Z = (np.uint64(CHUNK * k) for k in range(3, 6))
DISTANCE = POSITION_X  # w, or depth without perspective, before it becomes a position
VIEW_X, VIEW_Y, VIEW_Z = (np.uint64(CHUNK * k) for k in range(6, 9))
N_DOT_V = np.uint64(CHUNK * 9)
LIGHT_X, LIGHT_Y, LIGHT_Z = (np.uint64(CHUNK * k) for k in range(10, 13))  # written by a light, as the next two
N_DOT_L, STRENGTH = (np.uint64(CHUNK * k) for k in range(13, 15))
DIFFUSE, SPECULAR = (np.uint64(CHUNK * k) for k in range(15, 17))  # written by a reflection model
DIFFUSE_SUM = np.uint64(CHUNK * 17)  # summed over the lights, a row a channel
SPECULAR_SUM = np.uint64(CHUNK * 20)
ALBEDO = np.uint64(CHUNK * 23)
INTENSITY = LIGHT_X  # the result, a row a channel, when no light is left to ask
NEXT_CHANNEL = np.uint64(CHUNK)
# Of shadows: the polygon's plane, n·P = OFFSET with a unit normal n, and how far the point is lifted above it. Planes
# of attributes come in groups of four: the row between is what the albedo leaves over.
PLANE_X, PLANE_Y, PLANE_Z, OFFSET, LIFT = (np.uint64(CHUNK * k) for k in range(27, 32))
SEEN_X, SEEN_Y, SEEN_Z, SLOPE_X, SLOPE_Y = (
    np.uint64(CHUNK * k) for k in range(32, 37)
)  # what the light sees, see shadow_lookup.py
TANGENT_X, TANGENT_Y, TANGENT_Z = (
    np.uint64(CHUNK * k) for k in range(37, 40)
)  # of anisotropic materials; of any length
N_ROW = 40


def make_rows(dtype):
    """Return the rows of one thread."""
    return np.zeros(N_ROW * CHUNK, dtype)
