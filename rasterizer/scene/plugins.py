"""Plug-ins: installed packages that enter lights and reflection models of their own, imported when one is first named.

A package says so by an entry point of the group `rasterizer.plugins`, whose name is the word that it enters, and whose
value is a function without arguments that enters it:

    [project.entry-points."rasterizer.plugins"]
    hemisphere = "my_lights:register"

A word that is in no table is looked for here, in every process: in a program, in the shell, in scene files, and where
a light or a material comes from another process.
"""

from collections.abc import Container

from ..errors import SceneError, faults_of

GROUP = "rasterizer.plugins"


def find_plugin(word: object, table: Container[str]) -> None:
    """Let the plug-in that has the name `word`, if any is installed, enter that into the table.

    Raises
    ------
    SceneError : the plug-in can't be imported, raises an error, or doesn't enter the word
    """
    if not isinstance(word, str) or word in table:
        return
    from importlib.metadata import entry_points

    for each in entry_points(group=GROUP, name=word):
        whose = f"the plug-in {word!r} of {each.value}"
        with faults_of(whose):
            each.load()()
        if word not in table:
            raise SceneError(f"{whose} enters no {word!r}")
        return
