"""Write files so that nobody ever sees half of one."""

import os
import secrets


def write_and_move(contents: dict[str, bytes]) -> None:
    """Write files, all of them or none: first hidden in the folders of their places, then renamed in turn.

    Parameters
    ----------
    contents : bytes by place, the real path of a file; what is there is replaced

    Raises
    ------
    OSError : a file can't be written or renamed; the hidden ones are removed, also by an interrupt
    """
    written = {}
    try:
        for place, content in contents.items():
            temporary = os.path.join(os.path.dirname(place), f".raster-{secrets.token_hex(8)}")
            with open(temporary, "xb") as stream:  # a new file; its mode is what the process's umask leaves
                written[temporary] = place
                stream.write(content)
        while written:
            temporary = next(iter(written))
            os.replace(temporary, written[temporary])
            del written[temporary]
    finally:
        for temporary in written:
            os.unlink(temporary)
