"""`python -m rasterizer` is `raster`."""

import sys

from .cli import main

sys.exit(main())
