"""A light from the sky and from the ground. As a program: the command line with this light."""

import sys
from dataclasses import dataclass, replace

from rasterizer import registries
from rasterizer.cli import main
from rasterizer.scene.color import linear_rgb
from rasterizer.scene.lights import Color, Vector
from rasterizer.scene.validate import unit3


@dataclass(frozen=True)
class HemisphereLight(registries.CustomLight):
    """Ambient light that is `color` from above and `ground` from below."""

    color: Color = 1.0
    ground: Color = 0.2
    up: Vector = (0.0, 1.0, 0.0)

    needs_position = False  # it is the same everywhere

    def __post_init__(self):
        for name in ("color", "ground"):
            object.__setattr__(self, name, linear_rgb(getattr(self, name), f"the hemisphere light's {name}"))
        object.__setattr__(self, "up", unit3(self.up, "the hemisphere light's up"))

    # ---- the engine's side: each half is a light of one colour, with a formula that is compiled

    def parts(self):
        below = tuple(-component for component in self.up)
        return replace(self, ground=0.0), replace(self, color=self.ground, ground=0.0, up=below)

    def numbers(self, frame):
        return frame.vector(self.up)

    @staticmethod
    def share(normal, position, up):
        """Return the part of a half sphere about `up` that a plane with this normal faces: (1 + N·up)/2."""
        return 0.5 + 0.5 * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2])

    def bound(self):
        return registries.LightBound(strength=1.0, normal=0.5)

    # ---- the reference's side: both halves at once, in plain numpy

    def reference(self, points, normals, frame):
        sky = (1.0 + normals @ frame.vector(self.up)) / 2.0
        return [(self.color, None, sky), (self.ground, None, 1.0 - sky)]


if __name__ == "__main__":
    registries.add_light("hemisphere", HemisphereLight)
    sys.exit(main())
