"""The flags of edges."""

from .. import choices
from ..options import Options
from . import values


def add_edges(group) -> None:
    """Add the flags of edges that are drawn over a picture."""
    add = group.add_argument
    add(
        "--edges",
        type=values.list_of(str, choices.EDGE_TYPES),
        metavar="LIST",
        help="edges of polygons drawn over the picture where nothing hides them, with commas between: wire (all), "
        "crease (where faces meet at more than the crease angle, or end), silhouette, all",
    )
    add("--edge-color", type=values.color, metavar="COLOR", help="of the edges (default black)")
    add("--edge-width", type=values.number, metavar="PX", help=f"of the edges (default {Options.edge_width:g})")
