"""What a file is that can't be read, or isn't what its name says: the hint that goes with the error.

Only the first bytes are looked at, and only once a reader has failed.
"""

import re

HEAD = 1024  # bytes that are looked at
_CAD = "it holds curved surfaces: export STL, 3MF or OBJ from the CAD program"
_SCENE = "export glTF (.glb) or OBJ from the program that made it"
_PACKED = "unpack it first"
_CLOUD = "a point cloud has no faces to draw"
_BY_SUFFIX = {
    word: hint
    for words, hint in (
        ("step stp iges igs brep brp sat x_t x_b sldprt sldasm ipt iam f3d fcstd catpart catproduct prt 3dm", _CAD),
        ("fbx blend dae usd usda usdc usdz max ma mb c4d 3ds x3d wrl vrml lwo skp abc amf vrm", _SCENE),
        ("zip gz bz2 xz zst 7z rar tar tgz", _PACKED),
        ("pcd las laz e57 pts ptx splat spz", _CLOUD),
        ("mtl", "it holds the materials of an .obj file: give that one"),
        ("bin", "it holds the numbers of a .gltf file: give that one"),
        (
            "png jpg jpeg webp tif tiff bmp gif exr npy npz",
            "a picture or an array is no model; outputs stand behind -o",
        ),
    )
    for word in words.split()
}
# What files begin with; where our own name of a format stands, another reader takes it.
_BY_CONTENT = (
    (rb"version https://git-lfs", "the file is a Git LFS pointer, not the model itself: `git lfs pull` fetches it"),
    (rb"(?i)\s*<(!doctype html|html)", "the file is an HTML page, perhaps of a download that failed"),
    (rb"\xff\xfe|\xfe\xff", "the file is text in UTF-16: save it as UTF-8"),
    (rb"\x1f\x8b|BZh|\xfd7zXZ|\x28\xb5\x2f\xfd", f"the file is compressed: {_PACKED}"),
    (rb"ISO-10303-21", f"the file is a STEP file: {_CAD}"),
    (rb"Kaydara FBX|; FBX", f"the file is an FBX file: {_SCENE}"),
    (rb"BLENDER", f"the file is a Blender file: {_SCENE}"),
    (rb"(?s)\s*<.{0,400}<?COLLADA", f"the file is a COLLADA file: {_SCENE}"),
    (rb"glTF", "glb"),
    (rb"ply\s", "ply"),
    (rb"(?s)PK\x03\x04.{26,200}?(3D/|_rels|\[Content_Types)", "3mf"),
    (rb"PK\x03\x04", f"the file is a ZIP archive: {_PACKED}"),
    (rb"(ST)?C?N?4?n?OFF\s", "off"),
    (rb"(?si)\s*solid\b.*\b(facet|endsolid)\b", "stl"),
    (rb"(?s)\s*\{.*\"(asset|accessors|bufferViews|meshes)\"", "gltf"),
    (rb"(?s)(#[^\n]*\n|\s)*((mtllib|o|g) [^\n]+\n(#[^\n]*\n|\s)*)*v[ \t]+[-+.\d]", "obj"),
)


def hint_for_suffix(suffix: str) -> str:
    """Return what to do with a file of a suffix that no reader takes, as "; what to do"; empty if that isn't known."""
    hint = _BY_SUFFIX.get(suffix.lower().removeprefix("."))
    return f"; {hint}" if hint else ""


def hint_for_content(data: bytes, format: str) -> str:
    """Return what a file is by its first bytes, as "; what it is".

    Parameters
    ----------
    data : the file's bytes
    format : name of the format that it was read as, without success

    Returns
    -------
    text, empty where the bytes tell nothing else than the name
    """
    head = bytes(data[:HEAD])
    found = next((what for pattern, what in _BY_CONTENT if re.match(pattern, head)), None)
    if found is None and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little") > 84:
        found = "stl"
    if found is None or found == format:
        return ""
    if " " in found:
        return f"; {found}"
    return f"; by its content it is {found}: --input-format {found}, or format='{found}'"
