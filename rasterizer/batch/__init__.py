"""Many pictures, in many processes and on many machines.

    tasks ─ runs ─ crew ─ records              crew: processes of this machine (processes.py), or any executor of
    tasks.py       executors.py                           concurrent.futures, Dask's among them (executors.py)

The caller's process alone writes: what draws sends back the bytes of files. So no death of a worker leaves half a file.
"""
