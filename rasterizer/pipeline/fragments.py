"""A batch of fragments: up to BATCH_SIZE surface points that are lit together, in the L1 cache.

A batch is one flat array. It holds one quantity after the other, each for BATCH_SIZE fragments: `batch[N_DOT_L + k]` is
the N·L of fragment k. These offsets are known when a kernel is compiled, so the compiler sees that quantities don't
overlap, and makes vector instructions of loops over k.

A vector is three quantities in a row, one for each axis of the world; its name is that of the first. Directions are
unit vectors and point away from the surface. Positions are relative to the eye, in scene units, so that float32 keeps
its digits far from the origin.
"""

from ..compiler.kernels import IS_COMPILING, helper

BATCH_SIZE = 256
# Loops over a batch become vector instructions for so many fragments; each of those that are left over takes as long as
# several of the others. Plain Python takes one by one.
SIDE_BY_SIDE = 32 if IS_COMPILING else 1


def _quantity(number):
    """Return where a quantity begins in a batch."""
    return BATCH_SIZE * number


NEXT = _quantity(1)  # from a quantity to the next one: the next axis of a vector, the next channel of a colour
NORMAL, POSITION, VIEW_DIR = _quantity(0), _quantity(3), _quantity(6)  # vectors
DISTANCE = POSITION  # w, or depth without perspective, before it becomes a position
N_DOT_V = _quantity(9)
LIGHT_DIR, N_DOT_L, STRENGTH = _quantity(10), _quantity(13), _quantity(14)  # written by a light function
WEIGHT = STRENGTH  # 1/r, by which what planes hold is multiplied, before there is a light
DIFFUSE, SPECULAR = _quantity(15), _quantity(16)  # written by a reflection function, and GRAZING and METAL
DIFFUSE_SUM, SPECULAR_SUM = _quantity(17), _quantity(20)  # over the lights, three channels each
ALBEDO = _quantity(23)  # three channels; planes come in fours, so a fourth quantity is written, too
INTENSITY = LIGHT_DIR  # the result, three channels, when no light is left to ask
# For shadows. The plane of the polygon is n·P = FACE_OFFSET with the unit normal n = FACE_NORMAL; FACE_SIDE is the
# length of its longest side, 0 of a point alone. The other three belong to shadow_lookup.py.
FACE_NORMAL, FACE_OFFSET, FACE_SIDE = _quantity(27), _quantity(30), _quantity(31)
FROM_LIGHT, LIMIT_SLOPES, SHADOW_COUNT = _quantity(32), _quantity(35), _quantity(40)
GRAZING, METAL = _quantity(32), _quantity(33)  # when the light's shadow has been looked up
TANGENT = _quantity(37)  # a vector of any length, of anisotropic materials
# Of materials with a metallic-roughness texture, which are not brushed: what it multiplies both numbers by.
METALLIC, ROUGHNESS = _quantity(37), _quantity(38)
# Of float64 alone, for looking textures up at exact setups (texcoords.py): texture coordinates, 1 / Σ q, and the
# weights of the three corners, whose sum is 1.
TEXCOORD_U, TEXCOORD_T, INVERSE_SUM, BARYCENTRIC = _quantity(41), _quantity(42), _quantity(43), _quantity(44)
N_QUANTITY = 47
BATCH_SHAPE = (N_QUANTITY * BATCH_SIZE,)


@helper
def filled_up(n):
    """Return the next multiple of SIDE_BY_SIDE from n on; for n <= BATCH_SIZE a batch has room for so many."""
    return (n + (SIDE_BY_SIDE - 1)) // SIDE_BY_SIDE * SIDE_BY_SIDE


@helper
def count_side_by_side(batch, n):
    """Return how many fragments are lit where a batch holds n: those behind hold anything. In float64, some of whose
    functions are no vector instructions, it is n."""
    return n if batch.itemsize == 8 else filled_up(n)


@helper
def get_vector(batch, quantity, k):
    """Return a vector of fragment k."""
    first = quantity + k
    return batch[first], batch[first + NEXT], batch[first + NEXT + NEXT]


@helper
def set_vector(batch, quantity, k, vector):
    """Set a vector of fragment k."""
    first = quantity + k
    batch[first], batch[first + NEXT], batch[first + NEXT + NEXT] = vector


@helper
def read_vector(numbers, first):
    """Return three numbers of an array in a row as a vector: an axis of the view, coefficients of a light."""
    return numbers[first], numbers[first + 1], numbers[first + 2]
