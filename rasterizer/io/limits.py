"""How much may be made of a file: what it states is counted before it is spent, and its text is cut.

A file of some bytes can ask for any number of others: by packing them, by stating counts, by referring to the same ones
again and again. So everything that is unpacked, copied or repeated is counted, in bytes and in meshes, and together it
may have

    bytes    RATIO times those of the files that were read, or LEAST where that is more
    meshes   one for MESH_BYTES bytes of these files, and LEAST_MESHES

Loading a file below 1 MB takes up to 300 MB and 10 s then: arrays are there four times at most while meshes are made,
and a mesh takes half a millisecond. Real files stay far below: text of numbers packs to a tenth, quantised vertices
grow eightfold, and 128 bytes for a mesh are less than its name, place and faces.
"""

from ..errors import ModelError

RATIO = 32
LEAST = 2**26
LEAST_TEXT = 2**23  # of what is unpacked and then parsed: trees of XML take several times as much
LEAST_MESHES, MESH_BYTES = 2**13, 128
MAX_NAME = 200  # letters of the name of a mesh or material
MAX_WARNINGS = 20  # of one file


def most(n_byte: int, least: int = LEAST) -> int:
    """Return how many bytes may be made of a file of `n_byte` bytes."""
    return max(least, RATIO * n_byte)


def name_in(text: object) -> str:
    """Return a name that stands in a file, cut: it may be as long as the file, and thousands of things may bear it."""
    return text[:MAX_NAME] if isinstance(text, str) else str(text)[:MAX_NAME]


class Allowance:
    """Count what is made of one file and those that it names.

    Parameters
    ----------
    n_byte : bytes of the file
    name : text, the file's name in errors, with what follows it; empty = the caller says where
    """

    def __init__(self, n_byte: int, name: str = ""):
        self.n_byte, self.name = n_byte, name
        self.n_made = self.n_mesh = self.n_warning = 0

    def make(self, n_byte: int) -> None:
        """Count bytes of arrays before they are made; ModelError where they are too many."""
        self.n_made += n_byte
        if self.n_made > most(self.n_byte):
            size = f"a file of {self.n_byte} bytes"
            raise ModelError(
                f"{self.name}asks for {self.n_made} bytes of arrays: too many for {size}, {most(self.n_byte)} are legal"
            )

    def show(self, n_mesh: int) -> None:
        """Count meshes, each as often as it is shown; ModelError where they are too many."""
        self.n_mesh += n_mesh
        legal = LEAST_MESHES + self.n_byte // MESH_BYTES
        if self.n_mesh > legal:
            size = f"a file of {self.n_byte} bytes"
            raise ModelError(f"{self.name}shows {self.n_mesh} meshes or nodes: too many for {size}, {legal} are legal")
