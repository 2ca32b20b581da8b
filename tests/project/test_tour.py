"""bench/tour.ipynb: every cell runs; the file itself holds no outputs."""

import importlib.util
import io
import json
import os
from base64 import b64decode

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
def test_no_cell_fails_and_all_pictures_are_there(outputs):
    complaints = [each for each in outputs if each.output_type == "error" or each.get("name") == "stderr"]
    assert not [each for each in complaints if not each.get("text", "").startswith("rasterizer: compiling ")]
    shown = [output.data for output in outputs if "data" in output]
    pictures = [Image.open(io.BytesIO(b64decode(data["image/png"]))) for data in shown if "image/png" in data]
    assert len(pictures) == 9, len(pictures)
