"""The kernels that a plan lists are those that its picture takes."""

import gc

import pytest
from helpers.campaign_scenes import make_case

import rasterizer as rz
from rasterizer.compiler import kernels
from rasterizer.engine.kernels_of_plan import list_kernels
from rasterizer.engine.prepared import PreparedScene
from rasterizer.engine.scene_tables import SceneTables

SEED = 12


def called() -> set:
    """What this process has called: (function, signature) of kernels, and of functions that they call."""
    kinds = kernels.Kernel, kernels.BatchFunction
    # By `type`: weak references answer for what they refer to.
    found = [thing for thing in gc.get_objects() if issubclass(type(thing), kinds)]
    own = [thing for thing in found if kernels.is_own(thing.py_func)]
    return {(thing.py_func, signature) for thing in own for signature in thing.signatures}


def options_of(case, number) -> dict:
    """How a case is drawn: with buffers now and then, and with all ways to average samples."""
    options = {"samples": 1} | case.options
    options["outputs"] = ("color", "depth", "face", "normal") if number % 3 == 0 else ("rgb",)
    return options


@pytest.mark.skipif(not kernels.STORE.is_used, reason="numba calls them, which has its own types")
@pytest.mark.parametrize("first", [0, *(pytest.param(n, marks=pytest.mark.nightly) for n in range(40, 400, 40))])
def test_a_picture_calls_no_kernel_that_is_not_listed(first):
    before = called()
    for number in range(first, first + 40):
        case = make_case(SEED, number)
        size = tuple(max(side // 3, 4) for side in case.size)
        try:
            with rz.Renderer(case.scene, size, threads=1, **options_of(case, number)) as renderer:
                renderer.render()
        except rz.SceneError:
            before = called()  # also what was called before the scene was refused
            continue
        scene, options = renderer.scene, renderer.options
        camera = scene.camera_for(size)
        tables = SceneTables(scene, options)
        plan = PreparedScene(tables, options).see(camera).drawing.plan  # in this view float64 may be needed
        after = called()
        listed = {*list_kernels(tables, options, camera), *list_kernels(tables, options, camera, plan)}
        missing = {(kernels.title_of(function), signature) for function, signature in after - before - listed}
        assert not missing, f"{case.words}: {missing}"
        before = after


def test_what_nobody_sees_costs_no_kernel():
    """A grey scene without textures, shadows or transparent surfaces lists nothing of these, and one type."""
    scene = rz.Scene(rz.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    with rz.Renderer(scene, 8) as renderer:
        tables, camera = SceneTables(scene, renderer.options), scene.camera_for(renderer.options.size)
        listed = [kernels.title_of(function) for function, _ in list_kernels(tables, renderer.options, camera)]
    unused = "texture", "layers.", "a_buffer.", "shadow", "clip.", "buffers.", "ears."
    assert not [title for title in listed if any(part in title for part in unused)] and len(listed) <= 13
