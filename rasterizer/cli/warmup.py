"""`raster warmup`: compile the kernels of all pictures.

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
    """Compile all kernels, on all cores, and put them into the store.

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
    """Tell whether a store is known to have the kernels of all pictures: these sources have listed them, and each is
    there."""
    listed = next(store.find(_LIST, (hash_package(),)), None)
    return listed is not None and all(any(store.find(*kernel)) for kernel in ast.literal_eval(listed.decode()))


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
    """List the kernels of all pictures, each once: those of every option on a table of small scenes."""
    from ..engine.ground_shadow import list_kernels as list_ground_kernels
    from ..engine.kernels_of_plan import list_kernels, list_mesh_kernels
    from ..engine.scene_tables import SceneTables

    opaque, _ = next(_pictures())
    found = dict.fromkeys([*list_mesh_kernels(), *list_ground_kernels(opaque)])
    for scene, settings in _pictures():
        for tolerance in (0.0, DEFAULT_TOLERANCE):
            options = Options(size=4, tolerance=tolerance, threads=1, **settings)
            found |= dict.fromkeys(list_kernels(SceneTables(scene, options), options, scene.camera_for(options.size)))
    return list(found)


def _pictures():
    """Yield scenes, each with options; together they need every kernel, which a test holds."""
    shadings = ("flat", "gouraud", "phong")
    samplings = [{"samples": n} for n in (1, 4, 9, 16)]
    scenes = _scenes()
    yield scenes[0], {"color_range": "global"}
    yield scenes[0], {"edges": "all"}
    for shading in shadings:
        yield scenes[0], {"shading": shading, "outputs": tuple(BUFFERS)}
        for scene in scenes:
            for sampling in samplings:
                yield scene, {"shading": shading, **sampling}


def _scenes() -> list:
    """Make scenes of all surfaces in all light."""
    import numpy as np

    from ..scene.camera import Camera
    from ..scene.lights import AmbientLight, DirectionalLight, PointLight, Shadow, SpotLight
    from ..scene.material import Material
    from ..scene.mesh import Mesh
    from ..scene.scene import Scene

    # A square with a crease; one corner lies behind the camera, so that it is clipped.
    points = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.5), (0.0, 0.0, 9.0)])
    faces = [(0, 1, 2), (0, 2, 3), (2, 3, 4)]

    def surface(colors=None, uv=None, **of_material):
        return Mesh(points, faces, colors=colors, uv=uv, material=Material(**of_material))

    def papered(**of_material):
        return surface(uv=points[:, :2], **of_material)

    plain, clear = surface(), surface(opacity=0.5)
    normals = replace(plain, normals=np.tile((0.0, 0.0, 1.0), (len(points), 1)))
    colored = surface(colors=np.linspace(0.0, 1.0, 15).reshape(5, 3))
    checks, brushed = np.eye(4, dtype=np.uint8), papered(reflection="cook-torrance", roughness=(0.2, 0.5))
    models = [surface(reflection=name, **more) for name in REFLECTIONS for more in ({}, {"fresnel": 0.1})]
    models += [surface(reflection="cook-torrance", distribution="beckmann")]
    models += [surface(reflection=name, fresnel=(0.9, 0.5, 0.1), roughness=0.5) for name in ("phong", "cook-torrance")]
    models += [surface(reflection="cook-torrance", roughness=(0.2, 0.5), tangent=(0, 1, 0))]
    surfaces = [
        [plain, replace(plain, smoothing=np.ones(3, np.int32)), normals],
        [Mesh(points, [(0, 1, 2, 3), (0, 1, 3, 2, 4)])],
        [colored],
        [colored, clear],
        [plain, clear],
        [papered(texture=checks)],
        [papered(texture=np.zeros((4, 4, 4), np.uint8), opacity=0.5)],  # whose texels let light through
        [brushed],
        [papered(reflection="cook-torrance", texture=checks, metallic=1.0)],
        [papered(reflection="cook-torrance", metallic_roughness=checks, metallic=1.0)],
        models,
    ]
    # Float64 for some surfaces of a picture in float32: without tangents and with them; and without a texture, with one
    # in float32, or in float64 alone.
    for double in (surface(reflection="toon"), brushed):
        for others in ([], [papered(texture=checks)], [papered(texture=checks, reflection="toon")]):
            surfaces += [[plain, double, *others], [plain, double, *others, clear]]
    shadow = Shadow(size=16)
    sun, lamp = DirectionalLight((0, -1, -1), 0.5, shadow=shadow), PointLight((0, 0, 1), 0.5, shadow=shadow)
    far_away = (50, 50, 50)  # float32 will do
    spot = SpotLight(far_away, (-1, -1, -1), 0.5)
    lights = [
        [AmbientLight(0.1), DirectionalLight((0, -1, -1), 0.5), PointLight(far_away, 0.5, (1, 0.1, 0))],
        [sun],
        [sun, lamp],
        [spot, replace(spot, falloff=2.0)],
    ]
    camera = Camera.perspective((0, 0, 5))
    scenes = [Scene(meshes, each, camera) for meshes in surfaces for each in lights]
    return [*scenes, Scene(models, lights[0], Camera.orthographic((0, 0, 5)), depth_cue=10.0)]
