"""What flags mean that were not given, where `Options` has no say, and the views that have names."""

UNSAID = ("unsaid",)  # the default of a flag for which None is a value; no text, which argparse would read
AZIMUTH, ELEVATION, FOV = 35.0, 25.0, 30.0  # those of Camera.framing; a test holds that
COMPARED_SIZE = (320, 240)  # four pictures beside each other, one of them by the reference, which is slow
PICTURE_SAMPLES = 4  # a picture is to look good; an array is to be exact, with Options' one sample

# name: (azimuth, elevation) in degrees; front is seen from +z with y up, from -y with z up
VIEWS = {
    "iso": (45.0, 35.264389682754654),  # atan(1/√2): the three axes look equally long
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "left": (-90.0, 0.0),
    "right": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}
