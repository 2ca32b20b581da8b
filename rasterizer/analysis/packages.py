"""Packages that only some questions need: a missing one is told of before anything is measured."""

from importlib import import_module

from ..errors import SceneError


def require(module: str, package: str, what: str) -> None:
    """Raise SceneError, in one line that says what to install, where a module can't be imported.

    Parameters
    ----------
    module : its name in Python
    package : its name for pip
    what : what needs it, as the message begins
    """
    try:
        import_module(module)
    except ImportError:
        raise SceneError(f"{what} needs {package}: pip install {package}") from None
