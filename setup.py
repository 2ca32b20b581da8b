"""What setup.cfg can't say: the long description is README.md without what only a checkout has."""

import re
from pathlib import Path

from setuptools import setup


def long_description() -> str:
    """Return README.md for a package index: pictures by their descriptions, links into the checkout by their words."""
    text = Path(__file__).with_name("README.md").read_text(encoding="utf-8")
    text = re.sub(r"!\[([^]]*)\]\([^)]*\)", r"*\1*", text)
    return re.sub(r"\[([^]]*)\]\((?!https?:)[^)]*\)", r"\1", text)


if __name__ == "__main__":
    setup(long_description=long_description())
