"""The variables of the environment that `raster` reads: name and what it does. The command line's page lists them all,
`raster doctor` those that are set."""

ENVIRONMENT = {
    "RASTER_STORE": "the only folder of compiled kernels; `off`: none are kept, and every process compiles",
    "RASTER_MOST_TEXELS": "the most texels of a file's texture, in place of 33.5 million (8192 × 4096)",
    "NUMBA_CACHE_DIR": "as `RASTER_STORE`, where that is not set",
    "NUMBA_DISABLE_JIT": "`1`: nothing is compiled. Only for small pictures, in a debugger",
    "NUMBA_CPU_FEATURES": "instructions that kernels may have, as numba reads it; such kernels are kept apart",
    "NUMBA_BOUNDSCHECK": "`1`: kernels that check every index, compiled for that alone",
    "XDG_CACHE_HOME": "the folder of caches; compiled kernels are kept in `rasterizer` below it. Default: `~/.cache`",
    "NO_COLOR": "if set: no colours in a preview, as with `TERM=dumb`",
}
