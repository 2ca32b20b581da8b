"""The model that comes with the package."""

from helpers.raster import ROOT

import rasterizer as rz

MODEL = rz.demo_model()


def test_it_is_the_gallerys():
    for path in (MODEL, MODEL.with_suffix(".mtl")):
        assert path.read_bytes() == (ROOT / "models" / path.name).read_bytes(), "run models/make_models.py"


def test_it_loads_with_all_its_materials(recwarn):
    scene = rz.load(MODEL)
    assert not recwarn.list
    assert scene.n_face == 5198 and len({material.name for mesh in scene.meshes for material in mesh.palette}) == 7
