"""The tables of the pages: rows of results as lines of Markdown.

In: the rows of a file of results/. Out: the lines of a table. tables.py puts them between their comments.
"""

import math

SHADINGS = ("flat", "gouraud", "phong")
NAMES = {"flat": "flat", "gouraud": "Gouraud", "phong": "Phong"}
_SCENES = {
    "dense": "a sphere of {n} triangles", "quads-front": "32 quads as large as the picture, the nearest first",
}  # fmt: skip
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def lines_of(head, rows) -> list[str]:
    """Cells as lines of a Markdown table."""
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


def figure(value, n_digit=2) -> str:
    """A number with a few digits, as people write it; nothing for None."""
    if value is None:
        return ""
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{n_digit - 1}e}"))))
    if -3 <= power < 5:
        return f"{value:.{max(n_digit - 1 - power, 0)}f}"
    digits = f"{value / 10.0**power:.{n_digit - 1}f}"
    return f"{digits}·10{str(power).translate(_SUPERSCRIPTS)}"


def thousands(value) -> str:
    """A whole number, its thousands apart."""
    return f"{value:,}".replace(",", " ")


# ── a frame ───────────────────────────────────────────────────────────────────────────────────────────────


def frames(rows) -> list[str]:
    """Milliseconds of a frame with one thread and two."""
    found = [[row["case"], thousands(row["triangles"]), NAMES[row["shading"]], figure(row["ms_1"], 3),
              figure(row.get("ms_2"), 3), figure(row["gain"], 3), figure(row["ns_triangle"]), figure(row["ns_pixel"])]
             for row in rows]  # fmt: skip
    return lines_of(["scene", "triangles", "shading", "ms 1T", "ms 2T", "gain", "ns/tri", "ns/px"], found)


def frames_in_short(rows) -> list[str]:
    """A scene a row, a shading a column: milliseconds with one thread / with two."""
    of = {(row["case"], row["shading"]): row for row in rows}
    triangles = {row["case"]: row["triangles"] for row in rows if row["case"] != "quads-back"}
    found = []
    for case, n in triangles.items():
        cells = [of.get((case, shading)) for shading in SHADINGS]
        found.append([_SCENES.get(case, f"{case}, {{n}} triangles").format(n=thousands(n)),
                      *("" if row is None else " / ".join(figure(row[key], 3) for key in ("ms_1", "ms_2") if key in row)
                        for row in cells)])  # fmt: skip
    return lines_of(["scene", *(NAMES[shading] for shading in SHADINGS)], found)


def memory(rows) -> list[str]:
    """Peak memory of a process, and the steps to its first picture."""
    found = [[thousands(row["triangles"]), row["size"], NAMES[row["shading"]], figure(row["build_ms"], 3),
              figure(row["prepare_ms"], 3), figure(row["warm_ms"], 3), figure(row["peak_mib"], 4)]
             for row in rows]  # fmt: skip
    return lines_of(["triangles", "size", "shading", "build ms", "prepare ms", "frame ms", "peak MiB"], found)


# ── speed against error ───────────────────────────────────────────────────────────────────────────────────


def tolerances(rows) -> list[str]:
    """What a tolerance costs, and what is left of the error."""
    found = [[row["model"], NAMES[row["shading"]], row["tolerance"], figure(row["ms"], 3), figure(row["of_first"]),
              figure(row["max"]), figure(row["bound"]), figure(row["of_bound"]), str(row["levels"]),
              figure(row["vertices"])]
             for row in rows]  # fmt: skip
    return lines_of(["model", "shading", "tolerance", "ms", "of tolerance 0", "max err", "bound", "/bound", "levels",
                     "1/256 px"], found)  # fmt: skip


def exactness(rows) -> list[str]:
    """The largest errors of one model by tolerance, and what becomes of 8-bit values."""
    rows = [row for row in rows if row["model"] == rows[0]["model"]]
    found = []
    for text in dict.fromkeys(row["tolerance"] for row in rows):
        same = {row["shading"]: row for row in rows if row["tolerance"] == text}
        over = sum(row["over_1"] for row in same.values())
        name = f"`tolerance={text}`" + (", the default" if text == "1/4096" else "")
        found.append([name, *(figure(same[shading]["max"], 1) for shading in SHADINGS), str(over or "none")])
    return lines_of(["", "flat", "Gouraud", "Phong", "8-bit values more than a level off"], found)


def methods(rows) -> list[str]:
    """Shadings and subdivisions with four samples a pixel."""
    found = [[row["model"], thousands(row["triangles"]), row["value"].partition(", 4 samples")[0],
              figure(row["ms"], 3), figure(row["rms"]), figure(row["of_method"]), figure(row["delta_e"])]
             for row in sorted(method_rows(rows), key=lambda row: (row["model"], row["ms"]))
             if row["samples"] == 4]  # fmt: skip
    return lines_of(["model", "triangles", "method", "ms", "rms err", "of method", "ΔE"], found)


def samples(rows) -> list[str]:
    """Phong's shading with more and more samples a pixel, the time and error as multiples of those of one."""
    found = []
    of = {(row["model"], row["samples"]): row for row in method_rows(rows) if row["shading"] == "phong"}
    for (model, n), row in sorted(of.items()):
        one = of[model, 1]
        found.append([model, str(n), figure(row["ms"], 3), figure(row["ms"] / one["ms"]), figure(row["rms"]),
                      figure(row["rms"] / one["rms"])])  # fmt: skip
    return lines_of(["model", "samples", "ms", "times the time", "rms err", "times the error"], found)


def method_rows(rows) -> list[dict]:
    """The rows of methods, of those of choices.json."""
    return [row for row in rows if row["what"] == "method"]


def axes(rows) -> list[str]:
    """One thing changed at a time, each of one scene: where rays tell what is right, else the first that has it."""
    rows = [row for row in rows if row["what"] not in ("method", "reflection")]
    scene_of = {}
    for row in rows:
        if row["what"] not in scene_of or row["against"].startswith("rays"):
            scene_of[row["what"]] = row["model"]
    found = [[row["model"], row["what"], row["value"], figure(row["ms"], 3), figure(row["ratio"]), figure(row["rms"]),
              figure(row["delta_e"]), row["against"]]
             for row in rows if row["model"] == scene_of[row["what"]]]  # fmt: skip
    return lines_of(["scene", "what", "value", "ms", "of the scene as it is", "rms err", "ΔE", "against"], found)


# ── refinement ────────────────────────────────────────────────────────────────────────────────────────────


def slopes(rows) -> list[str]:
    """With which power of the edges' length errors fall, at the finest meshes, beside theory."""
    from bench.refinement import ROUNDED, THEORY, last_slopes

    surfaces = [name for name in dict.fromkeys(row["surface"] for row in rows)
                if any(row["surface"] == name and row["rms"] > ROUNDED for row in rows)]  # fmt: skip
    found = []
    for name in (*SHADINGS, "silhouette"):
        cells = []
        for surface in surfaces:
            own = [row for row in rows if row["surface"] == surface]
            key, shading = ("silhouette_slope", "flat") if name == "silhouette" else ("slope", name)
            cells += [f"{slope:.2f}" for slope in last_slopes(own, shading, key)] or [""]
        found.append([NAMES.get(name, "area of the silhouette"), str(THEORY[name]), *cells])
    return lines_of(["", "theory", *surfaces], found)


def finer(rows) -> list[str]:
    """Gouraud's method on four times as many triangles, against Phong's: time and error as multiples."""
    of = {(row["surface"], row["shading"], row["triangles"]): row for row in rows}
    counts = sorted({row["triangles"] for row in rows if ("sphere", "gouraud", 4 * row["triangles"]) in of})
    surfaces = [name for name in dict.fromkeys(row["surface"] for row in rows) if name != "plane"]
    found = []
    for n in counts:
        cells = []
        for surface in surfaces:
            phong, gouraud = of[surface, "phong", n], of[surface, "gouraud", 4 * n]
            cells.append(f"{figure(gouraud['ms'] / phong['ms'])} · {figure(gouraud['rms'] / phong['rms'])}")
        found.append([f"{thousands(4 * n)} / {thousands(n)}", *cells])
    return lines_of(["triangles, Gouraud / Phong", *surfaces], found)


def hard_cases(rows) -> list[str]:
    """The hard cases, why each is right, its error and its bound."""
    found = [
        [row["case"], row["why"], *("" if row.get(key) is None else f"{row[key]:.1e}" for key in ("error", "bound"))]
        for row in rows
    ]
    return lines_of(["case", "what happens, and why that is right", "error", "bound"], found)


# ── features ──────────────────────────────────────────────────────────────────────────────────────────────


def features(rows) -> list[str]:
    """What each thing that a scene may use costs."""
    plain = next(row for row in rows if row.get("feature") == "plain")
    found = [[row["feature"], figure(row["ms"], 3), figure(row["ms"] / plain["ms"]),
              "" if row is plain else figure(row["ns_more"]), row["dtype"]]
             for row in rows if "feature" in row]  # fmt: skip
    return lines_of(["feature", "ms", "of plain", "more ns/px", "dtype"], found)


def maps(rows) -> list[str]:
    """To draw the shadow maps of a light."""
    found = [[row["light"], thousands(row["triangles"]), f"{row['texels']}²", figure(row["ms_1"], 3),
              figure(row["ms_2"], 3)] for row in rows if "light" in row]  # fmt: skip
    return lines_of(["light", "triangles", "texels a map", "ms 1T", "ms 2T"], found)


def buffers(rows) -> list[str]:
    """Outputs, as multiples of Gouraud's picture."""
    rows = [row for row in rows if "outputs" in row]
    cases = list(dict.fromkeys(row["scene"] for row in rows))
    of = {(row["scene"], row["outputs"]): row for row in rows}
    found = [[outputs, *(figure(of[case, outputs][key]) for case in cases for key in ("ratio_1", "ratio_2"))]
             for outputs in dict.fromkeys(row["outputs"] for row in rows)]  # fmt: skip
    return lines_of(["outputs", *(f"{case} {n}T" for case in cases for n in (1, 2))], found)


# ── peers, start-up, files ────────────────────────────────────────────────────────────────────────────────


def peers(rows) -> list[str]:
    """How many times as long other renderers take."""
    found = [
        [f"`{row['case']}`", thousands(row["triangles"]), row["peer"], f"{row['ms_ours']:.2f}",
         f"{row['ms_peer']:.2f}", f"{row['ratio']:.1f}", f"{row['ratio_of_cpu']:.1f}"]
        for row in rows if "peer" in row
    ]  # fmt: skip
    return lines_of(["case", "triangles", "peer", "ours, ms", "peer, ms", "peer/ours", "of CPU"], found)


def specks(rows) -> list[str]:
    """What a few pixels cost that need more than the others."""
    found = [row for row in rows if "speck" in row]
    names = list(dict.fromkeys(row["speck"] for row in found))
    ratio = {(row["speck"], row["shading"]): f"{row['ratio_of_cpu']:.2f}" for row in found}
    return lines_of(["speck", "Gouraud", "Phong"],
                    [[name, *(ratio.get((name, each), "") for each in SHADINGS[1:])] for name in names])  # fmt: skip


def programs(rows) -> list[str]:
    """Whole processes."""
    found = [[f"`{row['program']}`", figure(row["ms"], 3), figure(row["yards"]), figure(row["peak_mib"], 3)]
             for row in rows if "program" in row]  # fmt: skip
    return lines_of(["program", "ms", "yards", "peak MiB"], found)


def stages(rows) -> list[str]:
    """What a process spends its time with."""
    found = [[row["stage"], f"{row['warm_ms']:.0f}", f"{row['share']:.0%}".replace("%", " %"),
              "" if row["cold_ms"] is None else f"{row['cold_ms']:.0f}"] for row in rows if "stage" in row]  # fmt: skip
    return lines_of(["stage", "warm ms", "share", "cold ms"], found)


def writers(rows) -> list[str]:
    """Means of milliseconds and sizes of PNG files."""
    rows = [row for row in rows if row["case"] == "mean"]
    sizes = list(dict.fromkeys(row["size"] for row in rows))
    of = {(row["size"], row["writer"]): row for row in rows}
    found = [[writer, *(cell for size in sizes for cell in (figure(of[size, writer]["ms"]),
                                                            f"{of[size, writer]['share']:.2f}"))]
             for writer in dict.fromkeys(row["writer"] for row in rows)]  # fmt: skip
    return lines_of(["writer", *(cell for size in sizes for cell in (f"{size}: ms", "share"))], found)


# ── scale ─────────────────────────────────────────────────────────────────────────────────────────────────

_COSTS = {"build_ms": "build ms", "prepare_ms": "prepare ms", "cpu_ms": "frame ms", "mib": "MiB"}


def growth(rows) -> list[str]:
    """Each cost at the first and the last point of an axis, and with which power it grows."""
    found = []
    for row in rows:
        if "slopes" not in row:
            continue
        points = [each for each in rows if each.get("axis") == row["axis"] and "n" in each]
        first, last = points[0], points[-1]
        cells = []
        for key in _COSTS:
            slope = row["slopes"][key]
            cells.append(f"{figure(first[key])}, {figure(last[key])}" + ("" if slope is None else f" · {slope:.2f}"))
        found.append([row["axis"], f"{thousands(first['n'])}, {thousands(last['n'])}", *cells])
    return lines_of(["what grows", "from, to", *_COSTS.values()], found)


def one_more(rows) -> list[str]:
    """What one thing more costs, at the end of each axis."""
    found = []
    for name in dict.fromkeys(row["axis"] for row in rows if "slopes" in row):
        before, last = [row for row in rows if row["axis"] == name and "n" in row][-2:]
        n = last["n"] - before["n"]
        cells = [figure(max(last[key] - before[key], 0.0) * scale / n)
                 for key, scale in zip(_COSTS, (1e3, 1e3, 1e3, 2.0**20), strict=True)]  # fmt: skip
        found.append([name, *cells])
    return lines_of(["one more of", "build µs", "prepare µs", "frame µs", "bytes"], found)


def held(rows) -> list[str]:
    """Memory after so many pictures."""
    return lines_of(["pictures", *(thousands(row["n"]) for row in rows)],
                    [["MiB held", *(f"{row['mib']:.1f}" for row in rows)]])  # fmt: skip


# ── modes and processes ───────────────────────────────────────────────────────────────────────────────────


def tolerance_modes(rows) -> list[str]:
    """What share of a tolerance is used in each mode, and the processor time of a frame over that with 1/4096."""
    found = [row for row in rows if "mode" in row]
    names = list(dict.fromkeys(row["tolerance"] for row in found))
    cells = {(row["mode"], row["tolerance"]): f"{row['used']:.2g}, {row['ratio']:.2f}" for row in found}
    modes = dict.fromkeys(row["mode"] for row in found)
    return lines_of(["", *names], [[mode, *(cells[mode, name] for name in names)] for mode in modes])


def mixed(rows) -> list[str]:
    """What interpolating intensities over some triangles might save of Phong's method."""
    found = [
        [row["model"], row["size"].replace("x", "×"), row["tolerance"], f"{row['faces']:.0%}", f"{row['samples']:.0%}",
         f"{row['gouraud']:.2f}", f"{row['saved']:.1%}"]
        for row in rows if "model" in row
    ]  # fmt: skip
    head = ["model", "size", "tolerance", "of the faces", "of the samples", "Gouraud/Phong", "saved at most"]
    return lines_of(head, found)


def throughput(rows) -> list[str]:
    """How many pictures a second so many processes draw."""
    found = [[f"{row['processes']}", f"{row['seconds']:.2f}", f"{row['per_second']:.0f}", f"{row['gain']:.2f}"]
             for row in rows]  # fmt: skip
    return lines_of(["processes", "s", "pictures a second", "gain"], found)


def paths(rows) -> list[str]:
    """Times without a path over those with it, a path a row and a scene a column."""
    of = {(row["path"], row["scene"]): row["ratio"] for row in rows}
    names, scenes = (list(dict.fromkeys(row[key] for row in rows)) for key in ("path", "scene"))
    found = [[name, *("" if (name, s) not in of else f"{of[name, s]:.2f}" for s in scenes)] for name in names]
    return lines_of(["without", *scenes], found)


TABLES = {
    "tolerance of each way": tolerance_modes, "mixed shading": mixed, "throughput": throughput,
    "frames": frames, "frames in short": frames_in_short, "memory": memory, "tolerances": tolerances,
    "exactness": exactness, "methods": methods, "samples": samples, "one thing at a time": axes, "slopes": slopes,
    "finer meshes": finer, "hard cases": hard_cases, "features": features, "shadow maps": maps, "buffers": buffers,
    "peers": peers, "specks": specks, "programs": programs, "stages": stages, "writers": writers, "growth": growth,
    "one more": one_more, "held memory": held, "paths": paths,
}  # fmt: skip
