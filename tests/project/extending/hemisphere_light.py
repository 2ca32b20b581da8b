"""A light from the sky and from the ground. As a program: the command line with this light."""

import sys
from dataclasses import dataclass, replace

from rasterizer import registries
from rasterizer.cli import main
from rasterizer.registries import Color, Vector, linear_rgb, unit3


@dataclass(frozen=True)
class HemisphereLight(registries.CustomLight):
    """Ambient light that is `color` from above and `ground` from below."""

    color: Color = 1.0  # the annotations say how the command line and scene files read the fields
    ground: Color = 0.2
    up: Vector = (0.0, 1.0, 0.0)
    needs_position = False  # it is the same everywhere

    def __post_init__(self):
        for name in ("color", "ground"):
            object.__setattr__(self, name, linear_rgb(getattr(self, name), f"the hemisphere light's {name}"))
        object.__setattr__(self, "up", unit3(self.up, "the hemisphere light's up"))

    def parts(self):  # each half is a light of one colour, with a formula
        below = tuple(-component for component in self.up)
        return replace(self, ground=0.0), replace(self, color=self.ground, ground=0.0, up=below)

    def numbers(self, frame):  # what the formula reads
        return frame.vector(self.up)

    @staticmethod
    def share(normal, position, up):  # compiled: the part of a half sphere that a plane with this normal faces
        return 0.5 + 0.5 * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2])

    def reference(self, points, normals, frame):  # both halves at once
        sky = (1.0 + normals @ frame.vector(self.up)) / 2.0
        return [(self.color, None, sky), (self.ground, None, 1.0 - sky)]


if __name__ == "__main__":
    registries.add_light("hemisphere", HemisphereLight)
    sys.exit(main())
