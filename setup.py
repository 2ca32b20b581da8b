"""What setup.cfg can't say: a wheel that holds machine code is for one platform, and for any Python there."""

from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel


class Wheel(bdist_wheel):
    """A wheel, with the kernels that `raster warmup --into rasterizer/kernels` has compiled, if any."""

    def finalize_options(self) -> None:
        """Tell whether there are kernels to hold."""
        super().finalize_options()
        self.root_is_pure = not any(Path("rasterizer/kernels").glob("*/*.kernel"))

    def get_tag(self) -> tuple[str, str, str]:
        """Return which Pythons, which interface and which platform the wheel is for."""
        python, abi, platform = super().get_tag()
        return (python, abi, platform) if self.root_is_pure else ("py3", "none", platform)


setup(cmdclass={"bdist_wheel": Wheel})
