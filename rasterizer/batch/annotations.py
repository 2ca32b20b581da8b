"""What a dataset says of a picture beside its files: its camera, and where each object is, how much of it is seen.

In:  a scene, the camera of a picture, its size        Out: a dict that can be written as JSON

What of an object is seen are the pixels whose centres show it: those of the buffer "object". What there is of it alone
are the pixels that it would have if it were the only one: of the same mesh, drawn by itself. Both are exact.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frame import Frame
from ..io.array_files import scale_of
from ..options import Options
from ..renderer import Renderer
from ..scene.camera import Camera
from ..scene.framing import corners_of_box
from ..scene.scene import Scene


class Annotator:
    """Annotate pictures of a scene; Renderers are kept from one to the next, until it is closed.

    Parameters
    ----------
    scene : what the pictures show
    options : Options of the pictures
    """

    def __init__(self, scene: Scene, options: Options) -> None:
        self._scene = scene
        self._shared: dict[str, Any] = {name: getattr(options, name) for name in ("shading", "cull", "threads")}
        self._size = options.size
        self._renderers: dict[Any, Renderer] = {}

    def close(self) -> None:
        """End the Renderers."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    def annotate(self, frame: Frame) -> dict[str, Any]:
        """Return what is said of a picture: `size`, `camera` and `objects`, see `render_many`."""
        camera = frame.camera
        assert camera is not None  # it was drawn here
        ids = frame.object if frame.has("object") else self._draw(None, "object", camera, self._size)
        rectangles = [_rectangle(corners_of_box(mesh.bounds), camera, self._size) for mesh in self._scene.meshes]
        objects = [self._annotate(k, ids, rectangles, camera) for k in range(len(rectangles))]
        return {"size": list(self._size), "camera": describe(camera, self._size), "objects": objects}

    def _annotate(self, k: int, ids: NDArray[np.int32], rectangles: list, camera: Camera) -> dict[str, Any]:
        """Return what is said of an object."""
        (width, height), (left, top, right, bottom) = self._size, rectangles[k]
        seen = ids == k
        others = rectangles[:k] + rectangles[k + 1 :]
        alone = seen
        if any(left < r and right > l and top < b and bottom > t for l, t, r, b in others):
            alone = self._draw(k, "mask", camera, self._size)
        n_alone, box_whole = int(alone.sum()), box_of(alone)
        n_whole = n_alone
        if left < 0 or top < 0 or right > width or bottom > height:  # its box; it itself may not
            left, top, right, bottom = _rectangle(self._scene.meshes[k].used_vertices, camera, self._size)
        if left < 0 or top < 0 or right > width or bottom > height:
            wide = self._draw(k, "mask", _widened(camera, self._size), (3 * width, 3 * height)).copy()
            wide[height : 2 * height, width : 2 * width] = alone
            n_whole, box = int(wide.sum()), box_of(wide)
            box_whole = None if box is None else [box[0] - width, box[1] - height, *box[2:]]
        n_seen = int(seen.sum())
        return {
            "name": self._scene.meshes[k].name,
            "box": box_of(seen),
            "pixels": n_seen,
            "visible": n_seen / n_alone if n_alone else 0.0,
            "pixels_alone": n_alone,
            "pixels_whole": n_whole,
            "box_whole": box_whole,
            "mask": encode_mask(seen),
            "mask_alone": None if n_alone == n_seen else encode_mask(alone),
        }

    def _draw(self, k: int | None, name: Any, camera: Camera, size: Any) -> NDArray[Any]:
        """Draw a buffer of one object, or of all, without a picture."""
        key = k, size
        if key not in self._renderers:
            scene = self._scene if k is None else Scene(self._scene.meshes[k])
            self._renderers[key] = Renderer(scene, size, samples=1, outputs=name, **self._shared)
        return self._renderers[key].render(camera).array(name)


def depth_said(frame: Frame, scale: Any) -> dict[str, float]:
    """Return what a manifest says of depths whose scale follows the picture; of others nothing."""
    return {"depth_scale": scale_of(frame.depth, scale)} if scale == "auto" and frame.has("depth") else {}


def describe(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """Return a camera as a dict: "opencv" with K, R and t, None without perspective; "opengl" with the pose."""
    opencv = None
    if camera.is_perspective:
        K, R, t = camera.to_opencv(size)
        opencv = {"K": K.tolist(), "R": R.tolist(), "t": t.tolist()}
    pose = camera.pose
    R, t = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
    opengl = {"pose": pose.tolist(), "R": (R + 0.0).tolist(), "t": (t + 0.0).tolist()}
    return {"opencv": opencv, "opengl": opengl, "height": camera.height}


def _rectangle(points: NDArray[Any], camera: Camera, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Return left, top, right and bottom of points, (n, 3), as the picture shows them, in pixels, and one more to each
    side: vertices are rounded. All of the plane where a point isn't before the eye."""
    pixels, depth = camera.project(points, size)
    if camera.is_perspective and depth.min() <= 2.0**-20 * np.abs(points - camera.view().eye).max():
        return -np.inf, -np.inf, np.inf, np.inf  # else rounding is below 2^-30 of x: a pixel of 2^30
    x, y = pixels.T
    return float(x.min() - 1), float(y.min() - 1), float(x.max() + 1), float(y.max() + 1)


def _widened(camera: Camera, size: tuple[int, int]) -> Camera:
    """Return the camera of a picture that is larger by its own size to each side, for a size three times as large."""
    (width, height), p = size, camera.projection(size)
    lens: dict[str, Any] = {"near": camera.near, "far": camera.far}
    if camera.height is not None:
        lens["height"] = 3 * camera.height
    else:
        lens["intrinsics"] = p.scale_x, p.scale_y, p.center_x - 0.5 + width, p.center_y - 0.5 + height
        lens |= {"size": (3 * width, 3 * height), "skew": p.skew}
    return Camera(position=camera.position, target=camera.target, up=camera.up, **lens)


# --- masks ----------------------------------------------------------------------------------------------------


def box_of(mask: NDArray[np.bool_]) -> list[int] | None:
    """Return [left, top, width, height] of what is set in a mask, (height, width), in pixels; None where nothing is."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    top, left = int(rows[0]), int(columns[0])
    return [left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1]


def encode_mask(mask: NDArray[np.bool_]) -> dict[str, list[int]]:
    """Return a mask, (height, width), as COCO's uncompressed run lengths: "size", and "counts" of pixels that are not
    set, that are, and so on in turns, down each column, the left one first.

    Source: COCO, cocodataset.org/#format-data, and maskApi.c of pycocotools.
    """
    pixels = mask.T.reshape(-1)  # copies: columns one after the other
    ends = np.flatnonzero(pixels[1:] != pixels[:-1]) + 1
    starts = np.concatenate([[0, 0] if pixels[0] else [0], ends])
    counts = np.diff(np.append(starts, len(pixels)))
    return {"size": list(mask.shape), "counts": counts.tolist()}


def decode_mask(mask: dict[str, Any]) -> NDArray[np.bool_]:
    """Return the mask, (height, width), that `encode_mask` has written."""
    height, width = mask["size"]
    is_set = np.arange(len(mask["counts"])) % 2 == 1
    return np.repeat(is_set, mask["counts"]).reshape(width, height).T
