"""The table of file formats: everything that must know a format asks it; and what is said of files that no reader
takes, or that aren't what their names say."""

import gzip

import pytest
from helpers.model_bytes import GLB, box, exported, gltf_with
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.io import formats
from rasterizer.io.formats import FORMATS


def test_a_stranger_is_an_error_that_lists_what_is_legal():
    for load in (lambda: rz.load("a.xyz"), lambda: rz.load(b"1", format=".XYZ")):
        with pytest.raises(rz.ModelError, match="unknown format 'xyz'; readable are obj, stl, .*, json$"):
            load()
    with pytest.raises(rz.ModelError, match="unknown format 'obj' of a scene file; readable are json$"):
        formats.format_of("scene", "obj", is_scene=True)


def test_entries_are_whole_and_say_which_are_no_text(tmp_path):
    assert [name for name, entry in FORMATS.items() if entry.is_binary] == ["glb", "3mf", "zae", "3dxml"]
    for name, entry in FORMATS.items():
        assert entry.name == name and callable(entry.read()) and formats.find(f".{name.upper()}") is entry
        if entry.is_binary:
            path = tmp_path / f"a.{name}"
            path.write_text("text")
            said = f"{name} is no text; open the file with mode 'rb'"
            with path.open() as opened, pytest.raises(rz.ModelError, match=said):
                rz.load(opened)


# --- files that aren't what their names say -----------------------------------------------------------------

GOOD = {
    "obj": exported(box(), "obj"), "stl": exported(box(), "stl"), "ply": exported(box(), "ply"),
    "off": exported(box(), "off"), "glb": GLB, "gltf": gltf_with(),
}  # fmt: skip


def loader(folder, format):
    """A function that loads data under the name of a format."""

    def load(data):
        (folder / f"part.{format}").write_bytes(data)
        return rz.load(folder / f"part.{format}")

    return load


@pytest.mark.parametrize("format", [name for name, entry in FORMATS.items() if not entry.is_scene])
def test_what_is_no_model_of_its_name_is_told(tmp_path, format):
    load = loader(tmp_path, format)
    for content, data in GOOD.items():
        if content == format:
            assert load(data).n_face == 12
            continue
        said = f"; by its content it is {content}: --input-format {content}, or"
        assert_refused(load, [(data, said)], rz.ModelError, f"{tmp_path}")
        assert rz.load(tmp_path / f"part.{format}", format=content).n_face == 12
    step = b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('x'),'2;1');\n" + b"#1=POINT();\n" * 9
    hints = [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 9\n", "a Git LFS pointer, .*git lfs pull"),
        (b"<!DOCTYPE html>\n<html><body>Not Found</body></html>" + b" " * 99, "an HTML page, perhaps of a download"),
        (b"\n<HTML>" + b"x" * 200, "an HTML page"),
        (gzip.compress(GOOD["obj"]), "compressed: unpack it first"),
        (step, "a STEP file: .*export STL"),
        (b"Kaydara FBX Binary  \0" + b"\x1a\0" * 90, "an FBX file: export glTF"),
        (b"BLENDER-v280" + b"\0" * 200, "a Blender file"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
        (b"", "the file is empty$"), (b" \n\t", "the file is empty$"),
        *((data, "") for data in (b"\0" * 100, b"hello world\n", b"\xff\xfe\x80\x81" * 50, b"[[[[[[")),
    ]  # fmt: skip
    cases = [(data, f"^(?!.*by its content).*{hint}") for data, hint in hints]
    assert_refused(load, cases, rz.ModelError, f"{tmp_path}/part.{format}: ")
    if format in GOOD:
        said = "^(?!.*(by its content|the file is (?!cut)))"
        half = GOOD[format][: len(GOOD[format]) // 2]
        try:
            load(half)
        except rz.ModelError:
            assert_refused(load, [(half, said)], rz.ModelError)


def test_a_suffix_that_no_reader_takes_says_what_to_do(tmp_path):
    hints = {
        "STEP": "export STL, 3MF or OBJ", "fbx": "export glTF", "zip": "unpack it", "las": "a point cloud has no",
        "mtl": "give that one", "png": "outputs stand behind -o",
    }  # fmt: skip
    said = "unknown format '{}'; readable are .*; .*{}"
    cases = [(tmp_path / f"part.{suffix}", said.format(suffix.lower(), hint)) for suffix, hint in hints.items()]
    assert_refused(rz.load, cases, rz.ModelError)
