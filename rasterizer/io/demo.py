"""The model that comes with the package, for a first picture without a file of one's own."""

from pathlib import Path

# Written by models/make_models.py: several objects and materials, one of them glass.
_MODEL = Path(__file__).parent.parent / "demo" / "still_life.obj"


def demo_model() -> Path:
    """Return the path of the model that comes with the package: a still life of seven objects, 5198 triangles.

        import rasterizer as rz
        frame = rz.render(rz.demo_model(), (640, 400), shading="phong")

    Returns
    -------
    Path of an OBJ file, beside which its materials stand; it is part of the package, so only read it
    """
    return _MODEL
