"""The model that comes with the package."""

import configparser
from fnmatch import fnmatch

from helpers.raster import ROOT

import rasterizer as rz

MODEL = rz.demo_model()
MATERIALS = MODEL.with_suffix(".mtl")


def test_it_is_the_gallerys():
    for path in (MODEL, MATERIALS):
        assert path.read_bytes() == (ROOT / "models" / path.name).read_bytes(), "run models/make_models.py"


def test_it_is_small_and_ships_with_the_package():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    patterns = setup["options.package_data"]["rasterizer"].split()
    for path in (MODEL, MATERIALS):
        name = path.relative_to(ROOT / "rasterizer").as_posix()
        assert any(fnmatch(name, pattern) for pattern in patterns)
    assert MODEL.stat().st_size + MATERIALS.stat().st_size < 200_000


def test_it_loads_with_all_its_materials(recwarn):
    scene = rz.load(MODEL)
    assert not recwarn.list
    assert scene.n_face == 5198 and len({material.name for mesh in scene.meshes for material in mesh.palette}) == 7
