"""One set of words: each flag of `raster render` is a word of `rz.render` that draws the same picture, or is on a list
with the reason why it is none."""

import json
import pickle
import shutil
from dataclasses import fields

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import picture, raster
from helpers.model_bytes import rich_gltf
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.appearance import Appearance
from rasterizer.cli.parser import make_command_parser
from rasterizer.options import Options
from rasterizer.viewpoint import Viewpoint

pytestmark = pytest.mark.usefixtures("folder")
SIZE, TORUS = (36, 27), str(ROOT / "models" / "torus.obj")
LAMP, SUN = ["--light", "directional:-1,-0.4,-0.2"], (rz.DirectionalLight((-1, -0.4, -0.2)),)
HEIGHTS = tuple(rz.load(TORUS).meshes[0].vertices[:, 1].tolist())
TEAL = "--color teal --exposure 3"
TEALS = {"color": "teal", "exposure": 3.0}

# Each flag by its name; what is written behind `raster render MODEL`, and the same as words.
SAME = {
    "azimuth": ("--azimuth 70", {"azimuth": 70}),
    "elevation": ("--elevation -20", {"elevation": -20}),
    "fov": ("--fov 60", {"fov": 60}),
    "ortho": ("--ortho", {"ortho": True}),
    "zoom": ("--zoom 2", {"zoom": 2}),
    "margin": ("--margin 20%", {"margin": 0.2}),
    "camera": ("--camera eye.json", {"camera": "eye.json"}),
    "eye": ("--eye 3,2,4 --fov 40", {"eye": (3, 2, 4), "fov": 40}),
    "target": ("--eye 3,2,4 --target 0,0.5,0 --ortho", {"eye": [3, 2, 4], "target": (0, 0.5, 0), "ortho": True}),
    "up": ("--up z", {"up": "z"}),
    "preset": ("--preset headlight", {"preset": "headlight"}),
    "shadows": ([*LAMP, "--shadows"], {"lights": SUN, "shadows": True}),
    "material": ("--material gold", {"material": "gold"}),
    "color": ("--color orange", {"color": "orange"}),
    "reflection": ("--reflection toon", {"reflection": "toon"}),
    "background": ("--background 0.2/0.1/0", {"background": (0.2, 0.1, 0)}),
    "depth-cue": ("--depth-cue 2,color=red", {"depth_cue": rz.DepthCue(2, color="red")}),
    "crease-angle": ("--crease-angle 1", {"crease_angle": 1}),
    "weighting": ("--weighting uniform --crease-angle 180", {"weighting": "uniform", "crease_angle": 180}),
    "subdivide": ("--subdivide 1 --shading gouraud", {"subdivide": 1, "shading": "gouraud"}),
    "shading": ("--shading flat", {"shading": "flat"}),
    "samples": ("--samples 1", {"samples": 1}),
    "cull": ("--cull back --eye 1,0,0 --target 1,0,5", {"cull": "back", "eye": (1, 0, 0), "target": (1, 0, 5)}),
    "color-range": (f"{TEAL} --color-range local", TEALS | {"color_range": "local"}),
    "exposure": (TEAL, TEALS),
    "spectral": (
        "--light directional:0,-1,0,color=orange --color teal --spectral 5",
        {"lights": rz.DirectionalLight((0, -1, 0), "orange"), "color": "teal", "spectral": 5},
    ),
    "edges": ("--edges wire,silhouette", {"edges": ("wire", "silhouette")}),
    "edge-color": ("--edges all --edge-color red", {"edges": "all", "edge_color": "red"}),
    "edge-width": ("--edges all --edge-width 3", {"edges": "all", "edge_width": 3}),
    "ground": ("--ground", {"ground": True}),
    "size": ("-s 20", {"size": 20}),
    "scalars": ("--scalars heights.npy", {"scalars": HEIGHTS}),
    "cmap": ("--scalars heights.npy --cmap magma", {"scalars": HEIGHTS, "cmap": "magma"}),
    "clim": ("--scalars heights.npy --clim=-0.1,0.2", {"scalars": HEIGHTS, "clim": (-0.1, 0.2)}),
}
# What these say isn't seen in the picture of a torus.
UNSEEN = {
    "tolerance": ("--tolerance 1/256", {"tolerance": 1 / 256}),
    "threads": ("--threads 2", {"threads": 2}),
    "min-opacity": ("--min-opacity 0.5", {"min_opacity": 0.5}),
    "drop-bad-faces": ("--drop-bad-faces", {"drop_bad_faces": True}),
    "allow-outside": ("--allow-outside", {"allow_outside": True}),
}
# Other words for the same, which are objects of a program.
OTHER = {
    "view": ("--view left", {"view": "left"}, "several, with commas, make a picture each"),
    "light": (LAMP, {"lights": SUN}, "a list of lights"),
    "shadow-size": ([*LAMP, "--shadows", "--shadow-size", "16"], {"lights": SUN, "shadows": rz.Shadow(16)}, "a Shadow"),
    "shadow-filter": (
        [*LAMP, "--shadows", "--shadow-filter", "9"], {"lights": SUN, "shadows": rz.Shadow(filter=9)}, "a Shadow",
    ),
    "no-ground": ("--no-ground", {"ground": False}, "True and False"),
    "input-format": ("--input-format obj", {"format": "obj"}, "rz.load has it by that name"),
}  # fmt: skip
# What isn't of a picture: of a command line, of files, of several pictures.
REFUSED = ("help", "recursive", "output", "skip-existing", "json", "verbose", "quiet", "array", "scale", "seed",
           "processes", "colorbar")  # fmt: skip


def test_every_flag_is_a_word_or_on_the_list():
    actions = make_command_parser("render")._actions  # noqa: SLF001 - argparse has no public list
    flags = {flag.removeprefix("--") for action in actions for flag in action.option_strings if flag.startswith("--")}
    tables = [set(table) for table in (SAME, UNSEEN, OTHER, REFUSED)]
    flags.remove("format")  # of pictures; the word is that of --input-format
    assert flags == set().union(*tables) and len(flags) == sum(map(len, tables))
    words = {word for _, words in (*SAME.values(), *UNSEEN.values()) for word in words}
    assert {flag.replace("-", "_") for flag in (*SAME, *UNSEEN)} <= words, "a flag's word has its name"


def draw(flags, words, model=TORUS) -> bytes:
    """Draw the picture of flags, which must be that of the words; return its bytes."""
    flags = flags.split() if isinstance(flags, str) else flags
    assert raster("render", model, "-o", "x.png", "-s", f"{SIZE[0]}x{SIZE[1]}", *flags) == 0
    frame, written = rz.render(model, **{"size": SIZE} | words), picture("x.png")
    drawn = frame.rgba if written.shape[2] == 4 else frame.rgb
    assert not differences(written, drawn), f"{flags} draws another picture than {words}"
    return frame.rgba.tobytes()


def test_a_flag_draws_what_its_word_draws(folder, capsys):
    camera = '{"position": [3, 2, 4], "target": [0, 0.2, 0], "fov": 50}'
    (folder / "eye.json").write_text(camera)
    np.save(folder / "heights.npy", HEIGHTS)
    seen = {draw("", {}): ""}
    for name, (flags, words, *_) in (SAME | UNSEEN | OTHER).items():
        found = seen.setdefault(draw(flags, words), name)
        assert found == ("" if name in (*UNSEEN, "no-ground", "input-format") else name), f"--{name} draws --{found}"
    capsys.readouterr()


def test_words_of_what_a_file_brings(folder, capsys):
    """A camera, a background, a depth cue, lights of which one refuses a shadow."""
    (folder / "a.gltf").write_bytes(rich_gltf())
    for flags, words in (("", {}), ("--camera file", {"camera": "file"}), ("--camera frame", {"camera": "frame"})):
        draw(flags, words, "a.gltf")
    lights = (SUN[0], rz.DirectionalLight((1, -0.5, 0), 0.5, shadow=False))
    camera = rz.Camera.perspective((3, 3, 3))
    rz.save(rz.Scene(rz.load(TORUS).meshes, lights, camera, background="navy", depth_cue=2), "a.json")
    (folder / "eye.json").write_text('{"position": [3, 2, 4], "fov": 50}')
    assert draw("--up z --camera file", {"up": "z", "camera": "file"}, "a.json") == draw("", {}, "a.json")
    assert rz.load("a.json").lights == lights
    pictures = [
        draw(flags, words, "a.json")
        for flags, words in (
            ("", {}),
            ("--shadows", {"shadows": True}),
            ("--camera frame", {"camera": "frame"}),
            ("--zoom 2", {"zoom": 2}),
            ("--up z", {"up": "z"}),
            ("--up z --camera eye.json --ground", {"up": "z", "camera": "eye.json", "ground": True}),
            ("--background transparent", {"background": "transparent"}),
            ("--depth-cue none", {"depth_cue": "none"}),
        )
    ]
    assert len(set(pictures)) == len(pictures)
    with pytest.raises(rz.SceneError, match="brings no camera"):
        rz.render(TORUS, SIZE, camera="file")
    capsys.readouterr()


def test_a_scene_file_asks_for_framing_and_options(folder, capsys):
    """Whatever the size: the file's framing is that of the picture, words replace some of it."""
    rz.save(rz.Scene(rz.load(TORUS).meshes, rz.headlight()), "b.json")
    table = json.loads((folder / "b.json").read_text())
    table |= {"camera": {"view": "left", "fov": 50}, "options": {"samples": 1, "shading": "gouraud", "size": 30}}
    (folder / "b.json").write_text(json.dumps(table))
    pictures = [
        draw(flags, words, "b.json")
        for flags, words in (
            ("", {}),
            ("-s 60x20", {"size": (60, 20)}),
            ("-s 60x20 --azimuth 5", {"size": (60, 20), "azimuth": 5}),
            ("-s 60x20 --camera frame", {"size": (60, 20), "camera": "frame"}),
            ("--samples 4", {"samples": 4}),
            ("--ground --shading phong", {"ground": True, "shading": "phong"}),
        )
    ]
    assert len(set(pictures)) == len(pictures)
    assert raster("render", "b.json", "-o", "x.png") == 0
    frame = rz.render("b.json")
    assert frame.size == (30, 30) and not differences(picture("x.png"), frame.rgba)
    with rz.Renderer("b.json") as renderer:
        again = pickle.loads(pickle.dumps(renderer))
        assert again.render(zoom=2).tobytes() == renderer.render(zoom=2).tobytes() and again.options == renderer.options
        again.close()
    assert rz.render("b.json", options=rz.Options(size=20)).stats.samples == 4 * 20 * 20, "all of them are given"
    capsys.readouterr()


# Words that a scene file doesn't have, and why.
NO_KEYS = {
    "camera": "it is the table of the camera, or of the other words of Viewpoint",
    "format": "the suffix of each file that it names tells it",
    "allow_outside": "a file can't let itself read what lies outside of its folder",
}
WRITTEN = {"depth_cue": {"scale": 2, "color": "red"}, "shadows": {"size": 16}}


def scene_file(words, name="words.json") -> str:
    """Write a scene file of the torus that says what words say; return its name."""
    shutil.copy(TORUS, "torus.obj")
    table = {"meshes": [{"file": "torus.obj"}], "camera": {}, "options": {}}
    groups = {each.name: where for cls, where in ((Viewpoint, "camera"), (Options, "options")) for each in fields(cls)}
    for word, value in words.items():
        if word == "lights":
            lights = value if isinstance(value, tuple) else (value,)
            value = [{"kind": "directional", "direction": each.direction, "color": each.color} for each in lights]
        is_plain = isinstance(value, (bool, int, float, str, list, tuple, dict))
        (table[groups[word]] if word in groups else table)[word] = value if is_plain else WRITTEN[word]
    with open(name, "w") as stream:
        json.dump({key: value for key, value in table.items() if value != {}}, stream)
    return name


def test_a_word_is_a_key_of_a_scene_file_or_on_the_list():
    more = [{"weighting": "area"}, {"view": (20, 70)}, {"outputs": "rgb"}, {"preset": "headlight", "lights": SUN}]
    more += [{"background": "transparent", "depth_cue": "none"}, {"preset": "tabletop", "shading": "gouraud"}]
    tried = [words for _, words, *_ in (*SAME.values(), *UNSEEN.values(), *OTHER.values())] + more
    tried = [words for words in tried if not NO_KEYS.keys() & words and words.get("shadows") != rz.Shadow(filter=9)]
    for words in tried:
        expected = rz.render(TORUS, **{"size": SIZE} | words)
        assert not differences(rz.render(scene_file({"size": SIZE} | words)).rgba, expected.rgba), words
    every = {each.name for cls in (Appearance, Viewpoint, Options) for each in fields(cls)}
    assert every == NO_KEYS.keys() | {word for words in tried for word in words}
    for word in ("format", "allow_outside"):
        with pytest.raises(rz.SceneError, match=f"words.json: unknown key .{word}"):
            rz.load(scene_file({word: "obj"}))


def test_a_scene_file_draws_one_picture_from_every_entry(capsys):
    """What is given comes first: lights in place of all, of a material the same fields, and where it is seen from."""
    file = {"size": SIZE, "samples": 1, "shading": "gouraud", "ground": True, "edges": ["wire"], "exposure": 1}
    file |= {"material": "gold", "color": "teal", "shadows": True, "preset": "headlight", "crease_angle": 10}
    file |= {"view": "left", "fov": 40, "zoom": 1.5, "margin": 0.1, "subdivide": 1}
    scene_file(file, "a.json")
    eye = {"size": SIZE, "target": (0, 0.3, 0), "eye": (3, 2, 4), "ortho": True}
    scene_file(eye | {"zoom": 0.5}, "b.json")
    scene_file({"size": SIZE, "azimuth": 10, "preset": "tabletop"}, "c.json")
    for name, given, meant in (
        ("a.json", {}, file),
        ("a.json", {"view": "front"}, file | {"view": "front"}),
        ("a.json", {"color": "red", "reflection": "toon"}, file | {"color": "red", "reflection": "toon"}),
        ("a.json", {"preset": "studio", "samples": 4}, file | {"preset": "studio", "samples": 4}),
        ("b.json", {"azimuth": 5}, {"size": SIZE, "azimuth": 5, "ortho": True, "zoom": 0.5}),
        ("b.json", {"fov": 50, "zoom": 2}, eye | {"fov": 50}),
        ("b.json", {"eye": (1, 1, 5), "material": "jade"}, eye | {"eye": (1, 1, 5), "zoom": 0.5, "material": "jade"}),
        ("c.json", {"shading": "gouraud"}, {"size": SIZE, "azimuth": 10, "preset": "tabletop", "shading": "gouraud"}),
        ("a.json", {"material": "jade"}, {word: file[word] for word in file if word != "color"} | {"material": "jade"}),
        ("c.json", {"view": "left"}, {"size": SIZE, "view": "left", "preset": "tabletop"}),
        ("c.json", {"eye": (1, 1, 5)}, {"size": SIZE, "eye": (1, 1, 5), "preset": "tabletop"}),
    ):
        expected = rz.render(TORUS, **meant).rgba
        assert not differences(rz.render(name, **given).rgba, expected), (name, given)
        listed = {word: ",".join(map(str, value)) for word, value in given.items() if isinstance(value, tuple)}
        flags = [f"--{word}={value}" for word, value in (given | listed).items()]
        task = rz.RenderTask(name, "task.png", given.pop("view", None), options=given)
        assert [record.error for record in rz.render_many([task], n_process=1)] == [None]
        assert raster("render", name, "-o", "one.png", *flags) == 0
        assert raster("batch", name, "-o", "many.png", "-j", "1", *flags) == 0
        for written in map(picture, ("task.png", "one.png", "many.png")):
            assert not differences(written, expected[..., : written.shape[2]]), (name, given)
    capsys.readouterr()


def test_a_turntable_has_the_size_of_a_scene_file_or_of_options(capsys):
    scene_file({"size": SIZE, "material": "gold", "samples": 1}, "a.json")
    assert rz.turntable("a.json", n_frame=2).frames[0].shape == (*SIZE[::-1], 4)
    assert rz.turntable(TORUS, n_frame=1, options=rz.Options(size=20)).frames[0].shape == (20, 20, 4)
    assert rz.turntable(TORUS, n_frame=1, samples=1).frames[0].shape == (240, 320, 4)
    assert raster("turntable", "a.json", "--frames", "2", "-o", "x-{frame}.png") == 0
    for number, frame in enumerate(rz.turntable("a.json", n_frame=2).frames):
        assert not differences(picture(f"x-{number}.png"), frame)
    capsys.readouterr()


def test_the_outputs_of_a_scene_file_are_what_a_file_of_arrays_holds(folder, capsys):
    scene_file({"size": SIZE, "outputs": ["depth", "face"]}, "d.json")
    task = rz.RenderTask("d.json", "task.npz")
    expected = rz.render("d.json").save("one.npz", array=("depth", "face")).read_bytes()
    for status in ("drawn", "skipped"):
        (record,) = rz.render_many([task], n_process=1, manifest="m.jsonl", existing="skip")
        assert record.status == status
        assert raster("batch", "d.json", "-o", "many.npz", "--skip-existing", "--manifest", "n.jsonl") == 0
        for written, manifest in (("task.npz", "m.jsonl"), ("many.npz", "n.jsonl")):
            assert (folder / written).read_bytes() == expected
            assert json.loads((folder / manifest).read_text())["files"] == {"depth": written, "face": written}
    scene_file({"samples": 3}, "e.json")
    with pytest.raises(rz.RasterizerError, match="e.json: options: samples must be one of 1, 4, 9, 16; given 3"):
        list(rz.render_many([rz.RenderTask("e.json", "e.png")], n_process=1))
    capsys.readouterr()


def test_words_are_combined_as_flags_are(capsys):
    for flags, words in (
        ("--material jade --color red --reflection blinn", {"material": "jade", "color": "red", "reflection": "blinn"}),
        (
            "--material diffuse=red,shininess=80,specular=0.5",
            {"material": {"diffuse": "red", "shininess": 80, "specular": 0.5}},
        ),
        ("--preset tabletop", {"preset": "tabletop"}),
        ("--preset tabletop --shadows", {"preset": "tabletop", "shadows": True}),
        ("--preset tabletop --shading gouraud", {"preset": "tabletop", "shading": "gouraud"}),
        (["--preset", "headlight", *LAMP, "--shadows"], {"preset": "headlight", "lights": SUN, "shadows": True}),
        ("--ground --shadows --color teal", {"ground": True, "shadows": True, "color": "teal"}),
        ("--ground --view left --ortho", {"ground": True, "view": "left", "ortho": True}),
        ("--view left --elevation 5 --zoom 1.5", {"view": "left", "elevation": 5, "zoom": 1.5}),
        ("--azimuth -40 --elevation 10", {"view": (-40, 10)}),
    ):
        draw(flags, words)
    capsys.readouterr()


def test_what_is_no_word_is_refused():
    for flag in REFUSED:
        with pytest.raises(rz.OptionError, match="render has no option"):
            rz.render(TORUS, SIZE, **{flag.replace("-", "_"): 1})


def test_every_entry_takes_the_words():
    words = {"color": "orange", "shadows": True, "lights": SUN, "crease_angle": 10}
    side = {"view": "left", "zoom": 1.5}
    expected = rz.render(TORUS, SIZE, **words, **side).rgba
    with rz.Renderer(TORUS, SIZE, **words) as renderer:
        assert not differences(renderer.render(**side).rgba, expected)
    options = rz.Options(size=SIZE, samples=1)
    assert rz.render(TORUS, options=options, samples=4, **words, **side).rgba.tobytes() == expected.tobytes()
    assert not differences(rz.turntable(TORUS, SIZE, 1, options=options, samples=4, **words, eye=(3, 2, 4)).frames[0],
                           rz.render(TORUS, SIZE, **words, eye=(3, 2, 4)).rgba)  # fmt: skip
    drawn = rz.render(TORUS, SIZE, **words, **side, samples=1).color
    y, x = np.argwhere(drawn.any(axis=2))[0]
    assert np.allclose(
        dict(rz.explain(TORUS, x, y, SIZE, **words, **side, samples=1).rows)["linear"], drawn[y, x], atol=1e-3
    )
    task = {"color": "orange", "shadows": True, "lights": SUN, "size": SIZE, "zoom": 1.5}
    with rz.render_many(
        [rz.RenderTask(TORUS, "many.png", "left", options=task, load={"crease_angle": 10})], n_process=1
    ) as batch:
        assert [record.error for record in batch] == [None]
    assert not differences(picture("many.png"), expected)


def test_words_that_contradict_each_other_or_are_not_legal():
    for words, said in (
        ({"eye": (1, 2, 3), "view": "top"}, "eye and target can't be used with view"),
        ({"eye": (1, 2, 3), "margin": 0.1}, "eye and target can't be used with view, azimuth, elevation or margin"),
        ({"target": (1, 2, 3)}, "target needs eye"),
        ({"camera": rz.Camera.perspective((1, 2, 3)), "fov": 3}, "given camera, fov"),
        ({"camera": 3}, 'camera must be a Camera, "file", "frame", a path or None; given 3'),
        ({"camera": "none.json"}, "none.json: no such file"),
        ({"camera": TORUS}, "^[^:]*torus.obj: unknown format .obj. of a scene file; readable are json"),
        ({"camera": ""}, "a path or None; given ''"),
        ({"allow_outside": "yes"}, "allow_outside must be True or False; given 'yes'"),
        ({"depth_cue": np.float32(-2)}, "the depth cue's scale must be above 0; given"),
        ({"view": "up"}, r"view must be one of iso, front, .*, or \(azimuth, elevation\); given 'up'"),
        ({"view": (1, 2, 3)}, "view must be one of"),
        ({"zoom": 0}, "zoom must be above 0; given 0"),
        ({"ortho": "yes"}, "ortho must be True or False; given 'yes'"),
        ({"shadows": "yes"}, "shadows must be True, False or a Shadow; given 'yes'"),
        ({"preset": "sun"}, "preset must be one of"),
        ({"material": "cheese"}, "a named material is one of"),
        ({"material": 3}, "material must be a Material, the name of one, or a dict of some of its fields; given 3"),
        ({"material": {"color": 1}}, "Material has no option 'color': did you mean diffuse"),
        ({"material": {"texture": np.eye(3)}}, "no texture coordinates"),
        ({"color": (255, 0, 0)}, "the color must be linear"),
        ({"color": "orangy"}, "the color must be a CSS name"),
        ({"subdivide": 16}, "subdivide must be a whole number within 0..15; given 16"),
        ({"options": {"samples": 1}}, "options must be Options or None"),
    ):
        with pytest.raises(rz.RasterizerError, match=said) as caught:
            rz.render(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), 8, **words)
        assert len(str(caught.value)) < 400, words
