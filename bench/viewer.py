"""How many pictures a second does the viewer show in a real browser, while a model is turned?

    python bench/viewer.py path/to/scan.obj                        its page, and the widget of JupyterLab
    python bench/viewer.py model.obj --seconds 10 --size 640 480   longer; another size of the picture

Needs Chromium and the extras `notebook` and `browser`. A pointer is dragged over the picture in circles. Counted are
the pictures that the canvas takes; their size is told, which is smaller where the machine is too slow for 33 a second.
At rest the picture must have its full size.
"""

import sys
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / name) for name in ("", "tests")]
from helpers.browser import browser, jupyterlab, missing, notebook_of, page_in, run_cells, wait_for_rest

import rasterizer as rz
from bench import measure
from rasterizer.viewer.server import Server
from rasterizer.viewer.session import Session

LOOKS = {"plain": {}, "tabletop": {"ground": True}}
COUNTING = """
window.drawn = [];
const draw = CanvasRenderingContext2D.prototype.drawImage;
CanvasRenderingContext2D.prototype.drawImage = function (...given) {
  window.drawn.push([performance.now(), this.canvas.width, this.canvas.height]);
  return draw.apply(this, given);
};
"""

# A move for each picture of the screen, as a hand makes them; sent from outside there are fewer.
TURNING = """
([x, y, seconds]) => new Promise((resolve) => {
  const canvas = document.querySelector("canvas");
  const start = performance.now();
  window.drawn = [];
  function move() {
    const angle = (performance.now() - start) / 500;
    if (angle > 2 * seconds) {
      resolve(window.drawn);
      return;
    }
    const at = { clientX: x + 90 * Math.sin(angle), clientY: y + 40 * Math.sin(2 * angle) };
    canvas.dispatchEvent(new PointerEvent("pointermove", { pointerId: 1, buttons: 1, bubbles: true, ...at }));
    requestAnimationFrame(move);
  }
  move();
})
"""


def add_arguments(parser) -> None:
    """Describe the command line."""
    parser.add_argument("model", help="a model's file")
    parser.add_argument("--size", nargs=2, type=int, default=(640, 480), help="of the picture (default: 640 480)")
    parser.add_argument("--seconds", type=float, default=5.0, help="of turning (default: %(default)s)")


def measure_viewers(args):
    """Yield a row for each look and place."""
    if reason := missing("jupyterlab", "ipykernel", "anywidget"):
        raise measure.MissingError(reason)
    with browser() as program:
        for look in LOOKS:
            for where in (page_of, widget_of):
                with where(program, args, look) as page:
                    wait_for_rest(page)
                    turn(page, 2.0)  # until it knows which size it can draw
                    yield {"where": where.__name__[:-3], "look": look} | turn(page, args.seconds)


@contextmanager
def page_of(program, args, look):
    """The viewer's own page; its picture fills the window, but for the bar."""
    session = Session(rz.Renderer(args.model, **LOOKS[look]).scene, **LOOKS[look])
    for is_rest in (False, True):  # kernels are compiled here
        session.answer({"size": list(args.size), "background": "#ffffff", "is_rest": is_rest, "events": []})
    server = Server(session)
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        with page_in(program, tuple(args.size)) as page:
            page.add_init_script(COUNTING)
            page.goto(server.url)
            box = page.locator("canvas").bounding_box()
            width, height = args.size
            page.set_viewport_size(
                {"width": 2 * width - round(box["width"]), "height": 2 * height - round(box["height"])}
            )
            yield page
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@contextmanager
def widget_of(program, args, look):
    """The widget in a cell of JupyterLab."""
    words = "".join(f", {name}={value!r}" for name, value in LOOKS[look].items())
    path = str(Path(args.model).resolve())
    cell = f"import rasterizer as rz\nrz.view({path!r}, {tuple(args.size)}{words})"
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "view.ipynb").write_text(notebook_of(cell))
        with jupyterlab(Path(folder)) as address, page_in(program, (1400, 1000)) as page:
            page.set_default_timeout(60_000)
            page.add_init_script(COUNTING)
            page.goto(address("view.ipynb"))
            run_cells(page)
            yield page


def turn(page, seconds: float) -> dict:
    """Drag a pointer over the picture; say what was shown meanwhile, and afterwards."""
    box = page.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    drawn = page.evaluate(TURNING, [x, y, seconds])
    page.mouse.up()
    wait_for_rest(page)
    canvas = "canvas => `${canvas.width}x${canvas.height}`"
    gaps = [after[0] - before[0] for before, after in zip(drawn, drawn[1:], strict=False)]
    sizes = [f"{width}x{height}" for _, width, height in drawn]
    return {
        "per_second": (len(drawn) - 1) / sum(gaps) * 1000.0, "slowest": max(gaps),
        "moving": max(set(sizes), key=sizes.count), "at_rest": page.eval_on_selector("canvas", canvas),
    }  # fmt: skip


main = measure.script("viewer", __doc__, add_arguments, measure_viewers)

if __name__ == "__main__":
    sys.exit(main())
