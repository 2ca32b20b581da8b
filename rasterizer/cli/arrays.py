"""What `--array` asks for: which arrays, in which file, at which scale."""

from pathlib import Path

from .. import choices
from ..choices import ARRAY_SUFFIXES, BUFFERS
from ..errors import OutputError, SceneError
from . import values

STDIO = "-"
EVERY = "all"  # color and every buffer


def add_arrays(parser) -> None:
    """Add the flags of arrays."""
    parser.add_argument(
        "--array",
        dest="outputs",
        action="append",
        choices=(EVERY, *dict.fromkeys((*choices.OUTPUTS, *choices.BUFFERS))),
        help="write this array of the picture, as .npy, .png or .exr (default MODEL.npy), or several, as .npz or .exr "
        "(repeat it; default MODEL.npz): color is linear float32, rgb uint8, "
        + "".join(f"{name} {text}, " for name, text in choices.BUFFERS.items())
        + "all color and every buffer; one sample a pixel, but for color and rgb with --samples",
    )
    parser.add_argument(
        "--scale",
        type=values.number,
        metavar="UNITS",
        help="scene units of 1 in a .png of the depth, which takes 1 to 65535 (default 0.001)",
    )


def suffix_of(output) -> str:
    """Return the suffix of an output, small letters without the point; "" where there is no output."""
    return Path(output or "").suffix.lower().lstrip(".")


def holds_arrays(arguments) -> bool:
    """Tell whether arrays are written, and no picture."""
    return bool(arguments.outputs) or suffix_of(arguments.output) in ARRAY_SUFFIXES


def expand_arrays(names) -> tuple[str, ...] | None:
    """Return the arrays that are asked for, each once; None where none are named."""
    if not names:
        return None
    names = (names,) if isinstance(names, str) else names
    every = ("color", *BUFFERS)
    return tuple(dict.fromkeys(name for given in names for name in (every if given == EVERY else (given,))))


def default_suffix(names) -> str:
    """Return the suffix of an output that is not named, with its point: of a picture, an array, or several."""
    if not names:
        return ".png"
    return ".npy" if len(expand_arrays(names) or ()) == 1 else ".npz"


def check_arrays(suffix, output, names) -> None:
    """Refuse what a file of arrays can't hold, before anything is drawn; `suffix` has its point."""
    from ..io.array_files import IN_PNG, import_exr

    names, asked = expand_arrays(names) or ("color",), f"--array {' --array '.join(names or [])}"
    if suffix not in (".npy", ".npz", ".exr", ".png"):
        raise SceneError(f"arrays are written as .npy, .npz, .exr or .png; given {output} for {asked}")
    if suffix in (".npy", ".png") and len(names) > 1:
        raise SceneError(f"a {suffix} file holds one array, .npz and .exr files several; given {output} for {asked}")
    if suffix == ".png" and names[0] not in IN_PNG:
        legal = ", ".join(name for name in IN_PNG if name in ("rgb", *BUFFERS))
        raise SceneError(f"a .png file holds {legal}; given {output} for {asked}: write it as .npy, .npz or .exr")
    if suffix == ".exr":
        if "rgb" in names:
            raise SceneError(f"an .exr file holds linear colours: give --array color; given {output} for {asked}")
        try:
            import_exr()
        except OutputError as error:
            raise SceneError(f"{output}: {error}") from None


def check_scale(arguments) -> None:
    """Refuse a scale for anything but the depth in a PNG file, or one that is not above 0."""
    is_png = suffix_of(arguments.output) == "png"
    if arguments.scale is not None and not (is_png and expand_arrays(arguments.outputs) == ("depth",)):
        raise SceneError("--scale is that of depth in a PNG file: it needs --array depth and -o NAME.png")
    if arguments.scale is not None and not arguments.scale > 0:
        raise SceneError(f"--scale must be a number above 0; given {arguments.scale:g}")


def encode_arrays(frame, output, names, scale) -> bytes:
    """Return arrays of a frame as the bytes of a file; on stdout .npy, several .npz. EXR files of colour have alpha."""
    format = suffix_of(output)
    if output == STDIO:
        format = "npy" if len(names) == 1 else "npz"
    if format == "exr" and "color" in names:
        names = (*names, "alpha")
    return frame.encode_arrays(names, format, scale)
