"""Speed against error: rows recomputed by other means, the front by definition, and what the advice says."""

import functools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import rasterizer as rz
from rasterizer import reference
from rasterizer.analysis.speed_error import (
    MAX_FACES,
    Errors,
    Method,
    Row,
    _groups,
    advise,
    draw_ground_truth,
    draw_light,
    list_methods,
    measure_errors,
    printed,
    rms_error,
    sort_by_front,
    study,
    subdivided,
)

SIZE = (32, 24)


def ball_scene():
    """A coarse ball that doesn't fill its picture."""
    rng = np.linspace(0, np.pi, 9), np.linspace(0, 2 * np.pi, 13)[:-1]
    points = [(np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)) for t in rng[0] for p in rng[1]]
    faces = []
    for row in range(8):
        for k in range(12):
            a, b, c, d = 12 * row + k, 12 * row + (k + 1) % 12, 12 * row + 12 + (k + 1) % 12, 12 * row + 12 + k
            faces += [(a, b, c), (a, c, d)]
    points = np.array(points)
    return rz.Scene(
        [rz.Mesh(points, faces, normals=points, material=rz.Material(diffuse=(0.7, 0.4, 0.2)))], rz.studio()
    )


def by_hand(scene, method, factor=1):
    """A picture as light on black, by the reference: another program, in float64."""
    finer = subdivided(scene, method.subdivisions)
    size = (SIZE[0] * factor, SIZE[1] * factor)
    picture = reference.render(finer, size, shading=method.shading, samples=method.samples)
    return picture.color * picture.alpha[..., None], picture.alpha


@pytest.fixture(scope="module")
def found():
    scene = ball_scene()
    methods = list_methods(("flat", "gouraud", "phong"), (0, 1), (1, 4), (0.0, 1 / 4096))
    return scene, study(scene, SIZE, methods, 90.0, lambda *_: None, threads=1)


def test_every_combination_has_a_row_or_is_named(found):
    _, result = found
    methods = [row.method for row in result.rows] + result.left_out
    assert sorted(methods) == sorted(list_methods(("flat", "gouraud", "phong"), (0, 1), (1, 4), (0.0, 1 / 4096)))
    assert len(methods) == (3 + 1) * 2 * 2 and not result.left_out


def test_errors_are_those_of_the_reference(found):
    """The ground truth by 64 samples of the reference, and every row's picture by the reference, give the same
    errors."""
    scene, result = found
    fine, fine_alpha = by_hand(scene, Method("phong", 0, 16, 0.0), 2)
    truth = fine.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3))
    truth_alpha = fine_alpha.reshape(SIZE[1], 2, SIZE[0], 2).mean(axis=(1, 3))
    drawn = functools.cache(lambda method: by_hand(scene, method))
    for row in result.rows:
        color, alpha = drawn(row.method._replace(tolerance=0.0))
        same, same_alpha = drawn(Method("phong", 0, row.method.samples, 0.0))
        room = row.method.tolerance + 1e-6

        def rms(a, b, a_alpha, b_alpha):
            return math.sqrt(np.mean((a - b)[(a_alpha > 0) | (b_alpha > 0)] ** 2))

        assert abs(row.error.rms - rms(color, truth, alpha, truth_alpha)) <= room, row.method
        assert abs(row.error.max - np.abs(color - truth).max()) <= room, row.method
        assert abs(row.of_method - rms(color, same, alpha, same_alpha)) <= room, row.method
        assert abs(row.of_sampling - rms(same, truth, same_alpha, truth_alpha)) <= 2e-6, row.method


def test_frames_take_time_and_more_samples_have_less_error(found):
    rows = {row.method: row for row in found[1].rows}
    for method, row in rows.items():
        if method.samples == 1:
            assert rows[method._replace(samples=4)].error.rms < row.error.rms
        assert row.ms > 0


USUAL = Method("gouraud", 0, 4, 1 / 4096)


def make_row(ms, rms, method=USUAL):
    return Row(method, ms, Errors(rms, rms, 0, 0.0, 0.0), 0.0, 0.0)


def test_the_front_is_what_nothing_beats():
    """Against the definition, row by row; ties in time or error included."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rows = [make_row(float(ms), float(rms)) for ms, rms in rng.integers(1, 9, (30, 2)) / 8]
        result = sort_by_front(rows)
        front = [row for row in result if not row.is_beaten]
        assert sorted((r.ms, r.error.rms) for r in result) == sorted((r.ms, r.error.rms) for r in rows)
        assert result[: len(front)] == front and [r.ms for r in front] == sorted(r.ms for r in front), seed
        for row in result:
            mine = row.ms, printed(row.error.rms)
            better = [other for other in rows if other.ms <= mine[0] and printed(other.error.rms) <= mine[1]]
            is_beaten = any((other.ms, printed(other.error.rms)) != mine for other in better)
            assert row.is_beaten == is_beaten, f"{seed}: {row}"
    alike = sort_by_front([make_row(1.0, 0.0012344), make_row(2.0, 0.0012341)])
    assert [row.is_beaten for row in alike] == [False, True], "errors that print alike are alike"


def test_advice_names_the_quickest_that_is_as_exact():
    phong, gouraud = Method("phong", 0, 4, 1 / 4096), Method("gouraud", 1, 4, 1 / 4096)
    text = advise([make_row(7.0, 0.0100, phong), make_row(5.0, 0.0105, gouraud), make_row(3.0, 0.2)])
    assert text == (
        "Choose Gouraud, subdivided once, 4 samples, tolerance 1/4096: rms 0.011 in 5 ms. The least error with as many "
        "samples has Phong, 4 samples, tolerance 1/4096: rms 0.01 in 7 ms."
    )
    text = advise([make_row(7.0, 0.0100, phong), make_row(5.0, 0.0125, gouraud)])
    assert text == "Choose Phong, 4 samples, tolerance 1/4096: rms 0.01 in 7 ms."
    assert advise([]) == ""


def test_advice_stays_the_same_where_times_are_too_close_to_call():
    """Two runs on a busy machine: the quicker one of two methods changes."""
    phong, gouraud = Method("phong", 0, 4, 1 / 4096), Method("gouraud", 1, 4, 1 / 4096)
    for times in ((7.0, 6.0), (6.0, 7.0)):
        rows = [make_row(ms, rms, each) for ms, rms, each in zip(times, (0.01, 0.0105), (phong, gouraud), strict=True)]
        assert advise([row._replace(spread=0.2) for row in rows]).startswith("Choose Phong, 4 samples")
    rows = [make_row(7.0, 0.01, phong), make_row(4.0, 0.0105, gouraud)]
    assert advise([row._replace(spread=0.9) for row in rows]).startswith("Choose Gouraud"), (
        "no noise makes it twice as slow"
    )


def test_without_time_or_room_the_given_mesh_is_measured_and_the_rest_is_named():
    methods = list_methods(("gouraud",), (0, 1, 2), (1,), (1 / 4096,))
    result = study(ball_scene(), SIZE, methods, 1e-6, lambda *_: None, threads=1)
    assert [row.method.subdivisions for row in result.rows] == [0]
    assert [method.subdivisions for method in result.left_out] == [1, 2]
    assert result.advice.endswith("Not measured: Gouraud, subdivided once and Gouraud, subdivided twice.")
    n = next(n for n in range(16) if 192 * 4**n > MAX_FACES)
    methods = list_methods(("gouraud",), (0, n), (1,), (1 / 4096,))
    result = study(ball_scene(), SIZE, methods, 9.0, lambda *_: None, threads=1)
    assert [method.subdivisions for method in result.left_out] == [n], "it would be too large"
    large = SimpleNamespace(n_face=MAX_FACES + 1)
    assert [finer for _, finer in _groups(large, methods)] == [large, None], "what is given is drawn however large"


def test_errors_of_pictures_that_are_known():
    scene = ball_scene()
    light = draw_light(scene, SIZE, shading="gouraud", threads=1)
    nothing = measure_errors(light, light)
    assert nothing[:4] == (0.0, 0.0, 0, 0.0) and not nothing.delta_e  # None where scikit-image isn't installed
    brighter = light._replace(color=np.where(light.alpha[..., None] > 0, light.color + 0.25, 0.0))
    errors = measure_errors(brighter, light)
    assert errors.max == pytest.approx(0.25) and errors.rms == pytest.approx(0.25) and errors.over_one == 1.0
    assert rms_error(brighter, light) == errors.rms
    empty = light._replace(color=0 * light.color, alpha=0 * light.alpha)
    assert measure_errors(empty, empty).max == 0 and rms_error(empty, empty) == 0.0
    assert measure_errors(light, empty).max == light.color.max()


def test_the_ground_truth_has_64_samples():
    """Coverage in 64ths, and more levels than 16 samples have."""
    alpha = draw_ground_truth(ball_scene(), SIZE, threads=1).alpha * 64
    assert np.abs(alpha - np.rint(alpha)).max() <= 1e-4 and (np.rint(alpha) % 4 != 0).any()
