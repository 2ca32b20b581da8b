"""Viewpoints whose camera may stand in a file: the words of a program or of the command line become one."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ..viewpoint import Viewpoint, check_words, is_path


def viewpoint_of(words: Mapping[str, Any]) -> Viewpoint:
    """Make a Viewpoint of its fields, where `camera` may be the path of a file, which is read.

    Parameters
    ----------
    words : fields of `Viewpoint`; those that aren't there have their defaults

    Raises
    ------
    SceneError : a value that is not legal, or words that contradict each other: before a file is read
    ModelError : a camera's file that can't be read
    """
    camera = words.get("camera")
    if is_path(camera):
        check_words({each.name: each.default for each in fields(Viewpoint)} | dict(words))
        from .scene_file import read_camera_file  # only here: most pictures need no file

        words = {**words, "camera": read_camera_file(camera)}
    return Viewpoint(**words)
