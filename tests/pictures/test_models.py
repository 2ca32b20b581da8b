"""Tests of the committed models: reproducible, small, wound outwards, closed where they should be."""

import importlib.util
import sys
from pathlib import Path

import pytest

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture(scope="module")
def maker():
    """Load make_models.py by path, with its folder importable for as long as that takes."""
    spec = importlib.util.spec_from_file_location("make_models", MODELS / "make_models.py")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(MODELS))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(MODELS))
    return module


def test_files_are_what_the_script_makes(maker):
    for name, data in maker.model_files().items():
        assert (MODELS / name).read_bytes() == data, f"{name} differs from what make_models.py makes"


def test_no_file_is_left_over(maker):
    suffixes = {".obj", ".mtl", ".ply", ".stl", ".glb", ".png"}
    assert {path.name for path in MODELS.iterdir() if path.suffix in suffixes} == set(maker.model_files())
