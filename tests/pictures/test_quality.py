"""Check how good pictures are: against the reference, true surfaces, and what shading methods promise."""

import numpy as np
from helpers.against_reference import EXACT
from helpers.pinhole import DULL, SHADINGS, unit
from helpers.raster import sheet
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import rasterizer as rz

DEFAULT = 1 / 4096
SIZE = (48, 36)


# ---------------------------------------------------------------- against the true surface


numbers = st.floats(-1, 1, allow_nan=False)
places = st.tuples(st.floats(-10, 58), st.floats(-10, 46))


@settings(max_examples=15, deadline=None)
@given(
    st.lists(places, min_size=3, max_size=3),
    st.tuples(numbers, numbers),
    st.tuples(numbers, numbers, st.floats(-1, -0.05)),
    st.booleans(),
    st.booleans(),
)
def test_flat_gouraud_and_phong_agree_on_a_lit_plane(points, slopes, direction, is_perspective, is_grey):
    """No highlight, a directional light, one plane: there is one intensity, and every method must find it."""
    depth = [3 + (s * (x / SIZE[0] - 0.5) + t * (y / SIZE[1] - 0.5)) for (x, y), s, t in ((p, *slopes) for p in points)]
    # Corners of a perspective sheet lie in a plane whatever their depths: there are only three.
    area = np.linalg.det(np.array([points[1], points[2]]) - points[0])
    assume(abs(area) >= 20)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight(direction, 0.8 if is_grey else (0.8, 0.5, 0.3)))
    scene = sheet(SIZE, points, depth, [[0, 1, 2]], lights, is_perspective, material=DULL)
    vertices = scene.meshes[0].vertices
    normal = unit(np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0]))
    normal = -normal if normal @ vertices[0] > 0 and is_perspective else normal
    normal = -normal if normal[2] < 0 and not is_perspective else normal
    n_dot_l = max(0.0, -(normal @ unit(np.array(direction))))
    expected = 0.7 * (0.1 + n_dot_l * np.array(lights[1].color))
    for shading in SHADINGS:
        for tolerance, budget in ((0.0, EXACT), (DEFAULT, DEFAULT)):
            frame = rz.render(scene, SIZE, shading=shading, tolerance=tolerance, samples=1)
            error = np.abs(frame.color - expected)[frame.alpha > 0].max(initial=0.0)
            assert error <= budget, f"{shading}: {error:.3g} > {budget:.3g}"
