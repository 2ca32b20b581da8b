"""Draw a work by VTK without a display: OpenGL by Mesa, through EGL or OSMesa, as VTK finds it.

VTK writes the shaders. They light every pixel, whatever is asked for, with Phong's reflection; flat shading takes the
normals of the faces. Lines are added to encode sRGB, and to leave highlights out of what the texture multiplies.
"""

import os
from dataclasses import replace

os.environ.pop("DISPLAY", None)  # so that VTK doesn't try it first, and warn

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

from bench.peers_work import Setup, Unable, Work

ENCODE = """
  vec3 linear = fragOutput0.rgb, curved = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
  fragOutput0.rgb = mix(12.92 * linear, curved, greaterThan(linear, vec3(0.0031308)));
"""
TEXTURED = "fragOutput0.rgb = (ambientColor + diffuse) * tcolor.rgb + specular;"
AFTER_LIGHT = "//VTK::Picking::Impl"  # the first place behind light and texture that VTK's shader has a name for


class Painter:
    """Draw the same picture whenever asked to; `rgba` is the last one."""

    def __init__(self, work: Work):
        setup = work.setup
        self.renderer = _make_renderer(setup)
        self.renderer.AddActor(_make_actor(work))
        self.window = vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetAlphaBitPlanes(1)
        self.window.SetMultiSamples(0 if setup.samples == 1 else setup.samples)
        self.window.SetSize(*setup.size)
        self.window.AddRenderer(self.renderer)
        self.bytes = vtk.vtkUnsignedCharArray()
        self.window.Render()
        lines = self.window.ReportCapabilities().splitlines()
        found = [line.partition(":")[2].strip() for line in lines if line.startswith("OpenGL renderer string")]
        if "llvmpipe" not in " ".join(found):
            raise RuntimeError(f"its OpenGL is {' '.join(found)}")
        self.version = f"VTK {vtk.vtkVersion.GetVTKVersion()}, {self.window.GetClassName()}, {' '.join(found)}"

    @staticmethod
    def adapt(work: Work) -> tuple[Setup, str]:
        """Return what both sides can draw alike, and what differs nevertheless.

        Raises Unable where each sample of a pixel shall be lit.
        """
        setup = work.setup
        if setup.is_lit_per_sample:
            raise Unable("it lights samples of a pixel together")
        differences = ["every pixel lit, with Phong's reflection"] if setup.shading != "phong" else []
        if setup.samples > 1:
            differences += ["other sample positions", "light and texture once a pixel", "averaged in sRGB"]
        return replace(setup, reflection="phong"), "; ".join(differences)

    def draw(self) -> None:
        """Draw a frame, and read it into memory."""
        width, height = self.window.GetSize()
        self.window.Render()
        self.window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, self.bytes)

    @property
    def rgba(self) -> np.ndarray:
        """The last picture, (height, width, 4) uint8."""
        width, height = self.window.GetSize()
        return vtk_to_numpy(self.bytes).reshape(height, width, 4)[::-1]


def _make_renderer(setup: Setup):
    """Set up camera and light; VTK's ambient light belongs to the material."""
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(0, 0, 0)
    renderer.SetBackgroundAlpha(0.0)
    camera = renderer.GetActiveCamera()
    eye, forward = np.array(setup.eye), np.array(setup.forward)
    camera.SetPosition(*eye)
    camera.SetFocalPoint(*(eye + forward))
    camera.SetViewUp(*setup.up)
    camera.SetViewAngle(setup.fov)
    camera.SetClippingRange(setup.near, setup.far)
    renderer.SetAutomaticLightCreation(False)
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPositional(False)
    light.SetPosition(*setup.light_dir)
    light.SetFocalPoint(0, 0, 0)
    light.SetColor(setup.light, setup.light, setup.light)
    renderer.AddLight(light)
    return renderer


def _make_actor(work: Work):
    """Load the mesh, the material and the texture."""
    setup = work.setup
    data = vtk.vtkPolyData()
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(work.positions, deep=True))
    data.SetPoints(points)
    cells = vtk.vtkCellArray()
    offsets = np.arange(0, work.faces.size + 1, 3, dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True),
                  numpy_to_vtkIdTypeArray(work.faces.ravel().astype(np.int64), deep=True))  # fmt: skip
    data.SetPolys(cells)
    if setup.shading != "flat":
        data.GetPointData().SetNormals(numpy_to_vtk(work.normals, deep=True))
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    {"flat": look.SetInterpolationToFlat, "gouraud": look.SetInterpolationToGouraud,
     "phong": look.SetInterpolationToPhong}[setup.shading]()  # fmt: skip
    look.SetColor(1, 1, 1)
    look.SetAmbient(setup.diffuse * setup.ambient)
    look.SetDiffuse(setup.diffuse)
    look.SetSpecular(setup.specular)
    look.SetSpecularPower(setup.shininess)
    look.SetBackfaceCulling(setup.cull == "back")
    if work.is_textured:
        data.GetPointData().SetTCoords(numpy_to_vtk(work.uv, deep=True))
        actor.SetTexture(_make_texture(work))
    lines = f"{TEXTURED if work.is_textured else ''}{ENCODE}{AFTER_LIGHT}"
    actor.GetShaderProperty().AddFragmentShaderReplacement(AFTER_LIGHT, False, lines, False)
    return actor


def _make_texture(work: Work):
    """Load the texture; VTK makes its mipmaps."""
    height, width = work.texels.shape[:2]
    image = vtk.vtkImageData()
    image.SetDimensions(width, height, 1)
    rows = np.ascontiguousarray(work.texels[::-1]).reshape(-1, 3)  # v grows upwards
    image.GetPointData().SetScalars(numpy_to_vtk(rows, deep=True))
    texture = vtk.vtkTexture()
    texture.SetInputData(image)
    texture.InterpolateOn()
    texture.MipmapOn()
    texture.RepeatOn()
    texture.UseSRGBColorSpaceOn()
    texture.SetMaximumAnisotropicFiltering(1)
    return texture
