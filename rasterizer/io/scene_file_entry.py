"""A value of a scene file with the place where it stands, so that every fault names file, place and what is legal."""

import re

from ..errors import ModelError, SceneError, shown

_KINDS = {dict: "a table", list: "a list", str: "text", bool: "true or false"}


class Entry:
    """Hold a value of a scene file.

    Parameters
    ----------
    value : what JSON or TOML has there
    file : text, the file's name
    where : text, the way to the value, such as lights[2].color; empty for the whole file
    """

    def __init__(self, value, file, where=""):
        self.value, self.file, self.where = value, file, where

    def fault(self, text, kind=SceneError) -> Exception:
        """Return the error that says what is wrong here."""
        return kind(f"{self.file}: {self.where}: {text}" if self.where else f"{self.file}: {text}")

    def _of_kind(self, kind):
        if type(self.value) is not kind:
            raise self.fault(f"must be {_KINDS[kind]}; given {shown(self.value)}")
        return self.value

    def text(self) -> str:
        """Return the value, which must be text."""
        return self._of_kind(str)

    def flag(self) -> bool:
        """Return the value, which must be true or false."""
        return self._of_kind(bool)

    def items(self) -> list["Entry"]:
        """Return the entries of a list."""
        return [Entry(value, self.file, f"{self.where}[{i}]") for i, value in enumerate(self._of_kind(list))]

    def names(self) -> dict[str, "Entry"]:
        """Return the entries of a table whose keys are up to the writer."""
        return {key: Entry(value, self.file, self._below(key)) for key, value in self._of_kind(dict).items()}

    def table(self, legal, needed=()) -> dict[str, "Entry"]:
        """Return the entries of a table.

        Parameters
        ----------
        legal : sequence of text, the keys that it may have
        needed : sequence of text, those that it must have

        Raises
        ------
        SceneError : no table, a key that is unknown or missing
        """
        for key in self._of_kind(dict):
            if key not in legal:
                place = Entry(None, self.file, self._below(key))
                raise place.fault(f"unknown key; legal are {', '.join(legal)}")
        for key in needed:
            if key not in self.value:
                raise self.fault(f"{key} is missing; needed are {', '.join(needed)}")
        return self.names()

    def _below(self, key) -> str:
        """The place of a key of this table."""
        word = key if re.fullmatch(r"[\w-]+", key) else shown(key)
        return f"{self.where}.{word}" if self.where else word

    def call(self, function, *args, **settings):
        """Call a function, and let its error name the place: that of the field of which it speaks, if it is one
        here."""
        try:
            return function(*args, **settings)
        except (ModelError, SceneError) as fault:
            # Errors of the scene's classes name a field as in "the point light's color must be ..", "the azimuth must
            # be ..".
            named = re.finditer(r"(?:'s|\bthe) (\w+)|^(\w+)", str(fault)) if isinstance(self.value, dict) else ()
            field = next((match[match.lastindex] for match in named if match[match.lastindex] in self.value), None)
            place = self if field is None else Entry(None, self.file, self._below(field))
            raise place.fault(str(fault), type(fault)) from fault
