"""`raster warmup`: compile the kernels of pictures of every kind.

Which kernels that are is kept in the store, too: where all of them are there, nothing is listed.
"""

import ast
import hashlib
import os
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from ..choices import BUFFERS, REFLECTIONS
from ..compiler import fingerprint, kernels
from ..compiler.store import Store
from ..engine.kernels_of_plan import list_kernels, list_mesh_kernels
from ..engine.scene_tables import SceneTables
from ..errors import OutputError
from ..options import DEFAULT_TOLERANCE, Options
from ..scene.camera import Camera
from ..scene.lights import AmbientLight, DirectionalLight, PointLight, Shadow, SpotLight
from ..scene.material import Material
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from .messages import compilation_shown

_VERTICES = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.5), (0, 0, 9)])
_FACES = np.array([(0, 1, 2), (0, 2, 3), (2, 3, 4)])
SIZE = 4  # pixels
_LIST = "list-of-kernels"  # how it is called in the store
_BUFFERS = tuple(BUFFERS)
_SHADINGS = ("flat", "gouraud", "phong")


def run_warmup(arguments, messages) -> tuple[list, int]:
    """Run the command; OutputError where there is no folder for the kernels. Nothing else fails."""
    warm_up(messages, arguments.into, arguments.cpu)
    return [], 0


def warm_up(messages, folder: str | None = None, processor: str | None = None) -> None:
    """Compile the kernels of all ways to shade, on all cores, and put them into the store.

    Parameters
    ----------
    folder : where a store that can be shipped is made; None = the user's own
    processor : what the code shall run on, one of PROCESSOR_LEVELS; None = this machine's

    Raises OutputError where there is no folder for them, and says why.
    """
    settings = {}
    if processor is not None:
        settings = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": fingerprint.features_of(processor)}
    with _environment_with(settings):
        _warm_up(messages, folder)


@contextmanager
def _environment_with(settings: dict):
    """Set variables of the environment inside the block: processes that compile inherit them."""
    before = dict(os.environ)
    os.environ.update(settings)
    try:
        yield
    finally:
        for name in settings:
            del os.environ[name]
        os.environ.update({name: before[name] for name in settings if name in before})


def _warm_up(messages, folder) -> None:
    start = perf_counter()
    store = _store_in(folder) if folder is not None else kernels.STORE
    if store.own is None:
        reasons = "; ".join(store.reasons) or "there is no folder for them"
        raise OutputError(f"compiled kernels can't be kept: {reasons}; RASTER_STORE names another folder")
    missing = [] if has_all(store) else _fill(store, messages)
    text = "ready" if missing else "were ready already"
    messages.notice(f"kernels {text} after {perf_counter() - start:.1f} s, in {store.own}")


def _fill(store, messages) -> list:
    """Compile what the store lacks; return what that was."""
    with compilation_shown(messages):
        listed = list_all_kernels()
        missing = kernels.missing_in(store, listed)
        kernels.compile_into(store, missing)
        failed = kernels.missing_in(store, missing)
    if failed:
        names = ", ".join(sorted({function.__name__ for function, _ in failed}))
        raise OutputError(f"not all kernels could be compiled into {store.own}: {names} (-v says why)")
    found = [(kernels.title_of(function), signature) for function, signature in listed if kernels.is_own(function)]
    store.keep(_LIST, (hash_package(),), repr(found).encode())
    return missing


def has_all(store: Store) -> bool:
    """Tell whether a store is known to have the kernels of all kinds of pictures: these sources have listed them, and
    each is there."""
    listed = next(store.find(_LIST, (hash_package(),)), None)
    return listed is not None and all(any(store.find(*need)) for need in ast.literal_eval(listed.decode()))


def hash_package() -> str:
    """Return 16 digits that change with every source of the package."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).resolve().parents[1].rglob("*.py")):
        digest.update(f"{path.name} {path.stat().st_size} ".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _store_in(folder):
    try:
        return Store.into(Path(folder))
    except OSError as fault:
        raise OutputError(f"no store can be made in {folder}: {fault.strerror or fault}") from fault


def list_all_kernels() -> list[kernels.Job]:
    """List the kernels of all kinds of pictures, each once."""
    found: dict[kernels.Job, None] = dict.fromkeys(list_mesh_kernels())
    for scene, settings in _pictures():
        for tolerance in (0.0, DEFAULT_TOLERANCE):
            options = Options(size=SIZE, tolerance=tolerance, threads=1, **settings)
            found |= dict.fromkeys(list_kernels(SceneTables(scene, options), options, scene.camera_for(options.size)))
    return list(found)


def _pictures():
    """Yield scenes of all kinds, each with how it is drawn, in all ways that have kernels of their own."""
    plain = [_scene(reflection, is_colored) for reflection in ("phong", "blinn") for is_colored in (False, True)]
    polygons = replace(plain[0], meshes=[Mesh(_VERTICES, [(0, 1, 2, 3), (0, 1, 3, 2, 4)])])
    for scene in (*plain, polygons, *_rarer_scenes()):
        for shading in _SHADINGS:
            for samples in (1, 4, 9, 16):
                for output in ("rgb", "color"):
                    yield scene, {"shading": shading, "samples": samples, "outputs": output}
                if samples > 1:
                    yield scene, {"shading": shading, "samples": samples, "antialias": "shade-once"}
    yield plain[0], {"color_range": "global"}
    yield plain[0], {"edges": "all"}
    for shading in ("flat", "phong"):
        yield plain[0], {"shading": shading, "outputs": _BUFFERS}


def _rarer_scenes():
    """Transparent, textured and shadowed scenes, and lights and reflection models that not every scene has."""
    plain = _scene("phong", False)
    colored, checks = _scene("phong", True), np.eye(4)
    shadow = Shadow(size=16)
    sun, lamp = DirectionalLight((0, -1, -1), 0.5, shadow=shadow), PointLight((0, 0, 1), 0.5, shadow=shadow)
    for scene in (plain, colored):
        clear = [replace(mesh, material=replace(mesh.material, opacity=0.5)) for mesh in scene.meshes]
        yield replace(scene, meshes=[*clear, scene.meshes[0]])
        yield replace(scene, lights=[sun, lamp])
        yield replace(scene, lights=[sun])  # float32 will do
    for opacity in (0.5, 1.0):
        look = Material(texture=checks, opacity=opacity)
        papered = [replace(mesh, uv=mesh.vertices[:, :2], material=look) for mesh in plain.meshes]
        yield replace(plain, meshes=papered)
        yield replace(plain, meshes=papered, lights=[sun])
    models = [Material(reflection=name, **extra) for name in REFLECTIONS for extra in ({}, {"fresnel": 0.1})]
    models += [Material(reflection="cook-torrance", distribution="beckmann")]
    models += [Material(reflection=name, fresnel=(0.9, 0.5, 0.1), roughness=0.5) for name in ("phong", "cook-torrance")]
    models += [Material(reflection="cook-torrance", roughness=(0.2, 0.5), tangent=(0, 1, 0))]
    meshes = [replace(plain.meshes[0], material=model) for model in models]
    spot = SpotLight((50, 50, 50), (-1, -1, -1), 0.5)
    far_away = Camera.orthographic((0, 0, 5))
    lights = [spot, replace(spot, falloff=2.0), DirectionalLight((0, -1, -1), 0.5)]
    yield replace(plain, meshes=meshes, lights=lights, camera=far_away, depth_cue=10.0)
    yield replace(plain, meshes=meshes, lights=[AmbientLight(0.1), *lights])
    brushed = replace(papered[0], material=Material(reflection="cook-torrance", roughness=(0.2, 0.5)))
    yield replace(plain, meshes=[brushed])
    yield replace(plain, meshes=[brushed], lights=[sun])
    # Float64 for some surfaces of a picture in float32: without tangents and with them; and without a texture, with one
    # in float32, or in float64 alone.
    smooth, smooth_papered = (
        replace(mesh, material=replace(mesh.material, reflection="toon")) for mesh in (plain.meshes[0], papered[0])
    )
    clear = replace(plain.meshes[0], material=replace(plain.meshes[0].material, opacity=0.5))
    for double in (smooth, brushed):
        for others in ([double], [double, papered[0]], [double, smooth_papered]):
            for behind in ([], [clear]):
                yield replace(plain, meshes=[*plain.meshes, *others, *behind])
                yield replace(plain, meshes=[*plain.meshes, *others, *behind], lights=[sun])


def _scene(reflection, is_colored) -> Scene:
    """A mesh with a crease that reaches behind the camera, so that it is clipped, in all kinds of light."""
    colors = np.linspace(0.0, 1.0, _VERTICES.size).reshape(_VERTICES.shape) if is_colored else None
    material = Material(reflection=reflection)
    meshes = [
        Mesh(_VERTICES, _FACES, colors=colors, material=material),
        Mesh(_VERTICES, _FACES, smoothing=np.ones(len(_FACES), np.int32), material=Material(specular=0.0)),
        Mesh(_VERTICES, _FACES, normals=np.tile((0.0, 0.0, 1.0), (len(_VERTICES), 1)), material=material),
    ]
    far_away = (50, 50, 50)  # float32 will do
    lights = [AmbientLight(0.1), DirectionalLight((0, -1, -1), 0.5), PointLight(far_away, 0.5, (1, 0.1, 0))]
    return Scene(meshes, lights, Camera.perspective((0, 0, 5)))
