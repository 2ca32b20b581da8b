"""The widget of a notebook, without one: what it answers to the messages of its cells."""

import base64
import io

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import ROOT
from helpers.viewing import click, drag, key, message
from PIL import Image

import rasterizer as rz


def test_messages_of_its_cells_are_answered_and_faults_told():
    pytest.importorskip("anywidget", reason="the extra notebook is not installed")
    widget, sent = rz.view(str(ROOT / "models" / "cube.obj"), (80, 60), threads=1), []
    widget.send = lambda content, buffers=(): sent.append((content, *buffers))  # what the kernel would carry

    def ask(content):
        widget._handle_custom_msg(content, [])  # noqa: SLF001 - as ipywidgets does with a cell

    assert widget.size == (80, 60) and widget.frame is None and widget.picked is None
    ask({"view": 3, "message": message(drag(9, 0), click(40, 30), is_rest=True)})
    ((content, picture),) = sent
    assert content["view"] == 3 and content["status"]["type"] == "image/png" and content["status"]["n_face"] == 12
    assert not differences(np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")), widget.frame.rgb)
    assert (widget.picked.x, widget.picked.y) == (40, 30) and widget.camera != widget.scene.camera_for((80, 60))
    for words in ({"ground": True}, {"ground": True, "azimuth": 10}):
        other = rz.view(widget.scene, (80, 60), threads=1, **words)
        assert other.camera == rz.render(widget.scene, (80, 60), threads=1, **words).camera, words
        other.close()
    ask({"view": 4, "message": {"size": 5}})
    assert sent[1][0]["view"] == 4 and "a message is an object of" in sent[1][0]["error"]
    ask({"message": message()})
    ask("nonsense")
    assert len(sent) == 2, "what isn't from the viewer's page is not answered"
    for switches, words in (([], {}), (["s"], {"shading": "flat"}), (["l", "l"], {"preset": "headlight"})):
        ask({"view": 3, "message": message(*map(key, switches))})
        bundle, _ = widget._repr_mimebundle_()  # where a notebook that was saved has no widget
        shown = Image.open(io.BytesIO(base64.b64decode(bundle["image/png"])))
        words = {"shading": "flat"} | words if switches else words
        seen = rz.render(widget.scene, (80, 60), camera=widget.camera, threads=1, **words)
        assert not differences(np.asarray(shown.convert("RGBA")), seen.rgba) and len(bundle) > 1, switches
    widget.close()
