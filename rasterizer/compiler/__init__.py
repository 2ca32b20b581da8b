"""What compiles: kernels as machine code, kept on disk, and called without numba.

Read kernels.py first: the stages import its decorators.

    kernels             the decorators: kernel, helper, batch function; signatures
    fingerprint         what decides the code: sources, versions, processor
    store               compiled kernels on disk
    machine_code        object code into memory
    layouts             where things stand in Python's and NumPy's objects
    entry_points        machine code that takes Python's arguments apart
    jobs                many kernels at once, in several processes
    internals           what is used of numba beyond its manual
    short_passes        what numba does before the optimiser, as far as kernels need it
"""
