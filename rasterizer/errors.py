"""The errors that the package raises, one small tree.

    RasterizerError
    ├── ModelError    a model that can't be read, is empty or is broken       (also a ValueError)
    ├── SceneError    an argument, light, material, camera or option that is not legal  (also a ValueError)
    └── OutputError   a picture or buffer that could not be written           (also an OSError)
"""


class RasterizerError(Exception):
    """Base of every error that this package raises on purpose."""


class ModelError(RasterizerError, ValueError):
    """A model can't be read, is empty, or is broken; the message names the file, the line where there is one, and the fault."""


class SceneError(RasterizerError, ValueError):
    """An argument is not legal; the message says what was given and what is legal."""


class OutputError(RasterizerError, OSError):
    """A picture or buffer could not be written."""
