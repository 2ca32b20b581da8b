"""bench/tour.ipynb: every cell runs and shows what it says; the file itself holds no outputs."""

import importlib.util
import io
import json
import os
import re
from base64 import b64decode

import numpy as np
import pytest
from helpers.raster import ROOT
from PIL import Image

PATH = ROOT / "bench" / "tour.ipynb"
CELLS = json.loads(PATH.read_text(encoding="utf-8"))["cells"]
MISSING = [name for name in ("nbclient", "ipykernel") if importlib.util.find_spec(name) is None]


def test_the_file_holds_no_outputs():
    for cell in CELLS:
        assert not cell.get("outputs") and cell.get("execution_count") is None and not cell["metadata"]
        assert cell["source"][-1] == cell["source"][-1].rstrip("\n")


@pytest.fixture(scope="module")
def outputs():
    """The outputs of all cells, run in a kernel of their own."""
    import nbclient
    import nbformat

    notebook = nbformat.read(PATH, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(PATH.parent)}})
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = str(ROOT)
    try:
        client.execute()
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


@pytest.mark.nightly  # a kernel is started
@pytest.mark.skipif(bool(MISSING), reason=f"{MISSING} are not installed: the extra browser brings them")
def test_every_cell_shows_what_it_says(outputs):
    complaints = [each for each in outputs if each.output_type == "error" or each.get("name") == "stderr"]
    assert not [each for each in complaints if not each.get("text", "").startswith("rasterizer: compiling ")]
    shown = [output.data for output in outputs if "data" in output]
    pictures = [Image.open(io.BytesIO(b64decode(data["image/png"]))) for data in shown if "image/png" in data]
    named = "flat, Gouraud, Phong, the lost highlight, creases, Mach bands, roughness, Fresnel, metamers"
    assert len(pictures) == len(named.split(", ")), named
    assert all(len(np.unique(np.asarray(picture.convert("L")))) > 30 for picture in pictures)
    said = [output["text"] for output in outputs if "text" in output]
    assert "I_P, between them" in said[0] and "I_Q, left" in said[0], "what Gouraud's method interpolates"
    rms = {line.split()[0]: float(line.partition("rms ")[2].partition(",")[0]) for line in said[1].splitlines()}
    assert rms["flat"] > rms["gouraud"] > rms["phong"] > 0
    jumps = [float(line.split()[-3]) for line in said[2].splitlines()]
    assert jumps[0] > jumps[1] > jumps[2], "slopes jump less from flat to Phong"
    brightness = {
        line.split("  ")[0]: [int(word) for word in re.findall(r"\d+\b(?=,|$)", line)] for line in said[3].splitlines()
    }
    middle, rim = zip(*brightness.values(), strict=True)
    assert rim[0] / middle[0] < 0.9 < rim[1] / middle[1] < 1 < rim[2] / middle[2], "the moon's rim is as bright"
    daylight, lamp = said[5].splitlines()
    xyz = re.findall(r"\[(.*?)\]", daylight)
    assert xyz[0] == xyz[1] and "[1. 1. 1.]" in lamp, "metamers have one colour, and the lamp is white"
    colors = np.asarray(pictures[-1].convert("RGB"), int)[90, [90, 298, 506, 714]]
    assert np.ptp(colors[:3], axis=0).max() <= 1 and colors[3][0] - colors[3][1] > 50, "they part under three lines"
