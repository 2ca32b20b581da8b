"""What flags mean that were not given, where `Options` has no say; the views that have names are in choices.py."""

from ..choices import VIEWS as VIEWS

UNSAID = ("unsaid",)  # the default of a flag for which None is a value; no text, which argparse would read
AZIMUTH, ELEVATION, FOV = 35.0, 25.0, 30.0  # those of Camera.framing; a test holds that
COMPARED_SIZE = (320, 240)  # four pictures beside each other, one of them by the reference, which is slow
TURNTABLE_SIZE, TURNTABLE_FRAMES, TURNTABLE_SECONDS = (512, 512), 36, 3.0
DEMO_SIZE = (800, 500)
SHEET_SIZE = (320, 240)  # of one picture on a sheet
SHEET_VIEWS = ("iso", "front", "right", "back", "left", "top")  # of one model
