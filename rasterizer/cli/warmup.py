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

from ..choices import BUFFERS, PROCESSOR_LEVELS, REFLECTIONS
from ..errors import OutputError
from ..options import DEFAULT_TOLERANCE, Options
from .flags import add_messages
from .messages import compilation_shown

_VERTICES = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.5), (0.0, 0.0, 9.0))
_FACES = ((0, 1, 2), (0, 2, 3), (2, 3, 4))
_SIZE = 4  # pixels
_LIST = "list-of-kernels"  # how it is called in the store
_EXAMPLES = """\
examples:
  raster warmup
  raster warmup --into kernels --cpu x86-64-v3    a store for other machines
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster warmup [options]"
    parser.description = "Compile the kernels of all shading methods and keep them on disk."
    parser.epilog = _EXAMPLES
    parser.add_argument(
        "--into",
        metavar="FOLDER",
        help="make a store that can be shipped: it is found where FOLDER is the installed package's folder `kernels` "
        "(default: the user's own store, which raster doctor names)",
    )
    parser.add_argument(
        "--cpu", choices=PROCESSOR_LEVELS, help="what the code shall run on (default: this machine's processor)"
    )
    add_messages(parser)


def run(arguments, messages) -> tuple[list, int]:
    """Compile the kernels of all ways to shade, on all cores, and put them into the store.

    Raises OutputError where there is no folder for them, and says why. Nothing else fails.
    """
    from ..compiler import fingerprint, kernels

    start = perf_counter()
    settings = {}
    if arguments.cpu is not None:
        settings = {"NUMBA_CPU_NAME": arguments.cpu, "NUMBA_CPU_FEATURES": fingerprint.features_of(arguments.cpu)}
    with _environment_with(settings):
        store = kernels.STORE if arguments.into is None else _store_in(arguments.into)
        if store.own is None:
            reasons = "; ".join(store.reasons) or "there is no folder for them"
            raise OutputError(f"compiled kernels can't be kept: {reasons}; RASTER_STORE names another folder")
        missing = [] if has_all(store) else _fill(store, messages)
    text = "ready" if missing else "were ready already"
    messages.notice(f"kernels {text} after {perf_counter() - start:.1f} s, in {store.own}")
    return [], 0


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


def _fill(store, messages) -> list:
    """Compile what the store lacks; return what that was."""
    from ..compiler import kernels

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


def has_all(store) -> bool:
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
    from ..compiler.store import Store

    try:
        return Store.into(Path(folder))
    except OSError as fault:
        raise OutputError(f"no store can be made in {folder}: {fault.strerror or fault}") from fault


def list_all_kernels() -> list:
    """List the kernels of all kinds of pictures, each once."""
    from ..engine.kernels_of_plan import list_kernels, list_mesh_kernels
    from ..engine.scene_tables import SceneTables

    found = dict.fromkeys(list_mesh_kernels())
    for scene, settings in _pictures():
        for tolerance in (0.0, DEFAULT_TOLERANCE):
            options = Options(size=_SIZE, tolerance=tolerance, threads=1, **settings)
            found |= dict.fromkeys(list_kernels(SceneTables(scene, options), options, scene.camera_for(options.size)))
    return list(found)


def _pictures():
    """Yield scenes of all kinds, each with how it is drawn, in all ways that have kernels of their own."""
    from ..scene.mesh import Mesh

    plain = [_scene(reflection, is_colored) for reflection in ("phong", "blinn") for is_colored in (False, True)]
    polygons = replace(plain[0], meshes=[Mesh(_VERTICES, [(0, 1, 2, 3), (0, 1, 3, 2, 4)])])
    for scene in (*plain, polygons, *_rarer_scenes()):
        for shading in ("flat", "gouraud", "phong"):
            for samples in (1, 4, 9, 16):
                for output in ("rgb", "color"):
                    yield scene, {"shading": shading, "samples": samples, "outputs": output}
                if samples > 1:
                    yield scene, {"shading": shading, "samples": samples, "antialias": "shade-once"}
    yield plain[0], {"color_range": "global"}
    yield plain[0], {"edges": "all"}
    for shading in ("flat", "phong"):
        yield plain[0], {"shading": shading, "outputs": tuple(BUFFERS)}


def _rarer_scenes():
    """Transparent, textured and shadowed scenes, and lights and reflection models that not every scene has."""
    from numpy import eye

    from ..scene.camera import Camera
    from ..scene.lights import AmbientLight, DirectionalLight, PointLight, Shadow, SpotLight
    from ..scene.material import Material

    plain = _scene("phong", False)
    colored, checks = _scene("phong", True), eye(4)
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


def _scene(reflection, is_colored):
    """A mesh with a crease that reaches behind the camera, so that it is clipped, in all kinds of light."""
    import numpy as np

    from ..scene.camera import Camera
    from ..scene.lights import AmbientLight, DirectionalLight, PointLight
    from ..scene.material import Material
    from ..scene.mesh import Mesh
    from ..scene.scene import Scene

    colors = np.linspace(0.0, 1.0, 3 * len(_VERTICES)).reshape(-1, 3) if is_colored else None
    material = Material(reflection=reflection)
    meshes = [
        Mesh(_VERTICES, _FACES, colors=colors, material=material),
        Mesh(_VERTICES, _FACES, smoothing=np.ones(len(_FACES), np.int32), material=Material(specular=0.0)),
        Mesh(_VERTICES, _FACES, normals=np.tile((0.0, 0.0, 1.0), (len(_VERTICES), 1)), material=material),
    ]
    far_away = (50, 50, 50)  # float32 will do
    lights = [AmbientLight(0.1), DirectionalLight((0, -1, -1), 0.5), PointLight(far_away, 0.5, (1, 0.1, 0))]
    return Scene(meshes, lights, Camera.perspective((0, 0, 5)))
