"""What a glTF file has and isn't used: named once a file, for those who ask."""

from .gltf_arrays import item

POINTS, LINES, LINE_LOOP, LINE_STRIP = range(4)  # modes of primitives without triangles
USED = {
    "EXT_texture_webp", "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness", "KHR_materials_specular", "KHR_materials_unlit", "KHR_mesh_quantization",
    "KHR_texture_transform",
}  # fmt: skip
_TEXTURES = {
    "normalTexture": "normal textures",
    "occlusionTexture": "occlusion textures",
    "emissiveTexture": "emissive textures, with their emission",
}


def list_left_out(tree: dict, primitives: list[dict], used: set) -> tuple[str, ...]:
    """Return texts about what isn't used of materials, extensions and motion.

    Parameters
    ----------
    tree : the file's JSON tree
    primitives : those that are shown
    used : the numbers of their materials
    """
    materials = [source for number, source in enumerate(tree.get("materials", [])) if number in used]
    found = [what for key, what in _TEXTURES.items() if any(key in source for source in materials)]
    surfaces = [source.get("pbrMetallicRoughness", {}) for source in materials]
    if any("metallicRoughnessTexture" in surface for surface in surfaces):
        found.append("metallic-roughness textures, but for their means")
    if any(
        "baseColorTexture" in surface and _has(source, "unlit")
        for surface, source in zip(surfaces, materials, strict=True)
    ):
        found.append("KHR_materials_unlit of textured materials, which are lit")
    if any(not source.get("doubleSided", False) for source in materials):
        found.append("doubleSided = false (backs are drawn unless they are culled)")
    extensions = {*tree.get("extensionsUsed", [])}.union(*(source.get("extensions", ()) for source in materials))
    found += [f"the extension {name}" for name in sorted(map(str, extensions - USED))]
    found += [what for what in ("animations", "skins") if tree.get(what)]
    return (*found, *(["morph targets"] if any("targets" in each for each in primitives) else []))


def count_points_and_lines(tree: dict, primitives: list[dict]) -> tuple[int, int]:
    """Return how many points and lines primitives have that are none of triangles."""
    n_point = n_line = 0
    for primitive in primitives:
        source = primitive["indices"] if "indices" in primitive else primitive["attributes"]["POSITION"]
        n = item(tree, "accessors", source)["count"]
        lines = {LINES: n // 2, LINE_LOOP: n, LINE_STRIP: n - 1}
        mode = primitive.get("mode")
        n_point += n if mode == POINTS else 0
        n_line += lines.get(mode, 0)
    return n_point, n_line


def _has(source, name) -> bool:
    return f"KHR_materials_{name}" in source.get("extensions", {})
