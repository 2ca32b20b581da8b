"""The longer texts of the help."""

RENDER = """\
examples:
  raster render part.stl                                     part.png, here
  raster render part.stl -o side.jpg --view left --ortho -s 1920x1080 --background white
  raster render 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view iso --view top -s 256 --json
  raster render part.obj --light ambient:0.2 --light directional:1,-1,0,color=#ffddaa
  raster render part.obj --material diffuse=orange,shininess=80 --shadows
  raster render scene.json -s 1920x1080                      a scene file, with its own lights and camera
  raster render part.obj --array depth -o depth.npy          float32, inf where nothing is
  cat part.stl | raster render - --input-format stl -o - > part.png

lights, in scene units, colours #f80, orange, 0.5 (linear grey) or 1/0.9/0.8 (linear):
  ambient:COLOR
  directional:X,Y,Z[,color=COLOR][,attached=camera][,shadow=yes]          the way the light goes
  point:X,Y,Z[,color=COLOR][,attenuation=KC/KL/KQ][,range=R][,amplify=yes][,attached=camera][,shadow=yes]
  spot:X,Y,Z,direction=X/Y/Z[,inner=A][,outer=A][,exponent=E][,falloff=P][, and as for point]     angles in degrees
  area:X,Y,Z,edge_u=X/Y/Z,edge_v=X/Y/Z[,resolution=M/N][, and as for point]           corner and two edges
attenuation is 1/(KC + KL d + KQ d^2), never above 1 without amplify; 1, 1/d, 1/(d+3) and 1/d^2 may be written as such
shadow is yes, no, SIZE or SIZE/FILTER: texels along its map, and along the square that softens its edge

materials: ambient diffuse specular emissive fresnel (colours) shininess opacity levels (numbers) roughness (a number,
or two, A/B, along the tangent and across) tangent (u or X/Y/Z) texture (a picture) reflection distribution (words)
normalized (yes or no); without ambient= the ambient follows diffuse. A name first, as in gold,shininess=80, takes the
rest from the classic table

a scene file (.json or .toml) holds models, materials, lights, camera, background, depth cue and options; flags come
first

exit codes: 0 done, 1 some models failed and the rest was done, or the fault is the program's own, 2 usage,
3 a model can't be read or is empty, 4 an output can't be written, 130 interrupted
"""


BATCH = """\
examples:
  raster batch 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view front,top -s 256 -j 4
  raster batch parts --recursive -o thumbs/ --skip-existing          the folders of parts, again below thumbs
  raster batch 'scans/*.obj' -o pictures/ --scheduler tcp://10.0.0.1:8786 --json

One picture that can't be drawn doesn't stop the others, whatever the reason. A file appears whole or not at all, so a
batch that was interrupted goes on with --resume or --skip-existing; these don't ask how a file was made. The last line
on stderr, and with --json the last on stdout, counts what was drawn, skipped and failed.

Dask's workers read models themselves where they see the same file, of the same length and time of change; else it is
loaded here and sent. Files are written here.

lights, materials, scene files: as in raster render --help

exit codes: 0 all done, 1 some models failed and the rest was done, or the fault is the program's own, 2 usage;
where no model could be drawn 3 or 4, as the first one says: it can't be read or is empty, its output can't be written;
130 interrupted
"""


COMPARE = """\
Draw each model with flat, Gouraud's and Phong's shading (or --methods) and with the reference, one sample a
pixel, side by side on one sheet. Below them are their errors, in false colours on one scale: the difference of linear
intensity from the reference's Phong shading. On stdout goes a table:

  ms                 a frame, median, with the default tolerance
  max, rms           error, in linear intensity where white is 1
  levels over 1      8-bit values, three a pixel, that are more than one level off
  value, slope jump  Mach bands: the largest jump of the intensity, and of its slope per pixel, across the edge
                     of two polygons where the surface is smooth; slope rms: over all such places
"""


BENCH = """\
Draw each model in many ways and measure them in turns: shading, subdivision, samples a pixel, tolerance. The rows
that no other row beats in time and error come first, the last line says what to choose.

  ms                 a warm frame, median
  rms, max           error of the picture against Phong's shading at 64 samples a pixel with tolerance 0, in
                     linear intensity where white is 1, over the pixels that either covers
  over 1, ΔE         share of 8-bit values more than a level off; mean colour difference (CIEDE2000)
  method, sampling   what makes that error: where light is evaluated, and how many samples see it (rms)
"""


VIEW = """\
Show a model in a page of your browser, to be turned, moved and zoomed. A click tells which face is seen, of which
object, where it is and how it is turned. At rest the picture is the one that `raster render` writes; while something
moves it may be smaller. The page says the camera in flags of `raster render`.

The address on stdout is served to this machine alone, and holds a random token. Over SSH: ssh -L 8000:localhost:8000
HOST, then there raster view MODEL --port 8000.
"""
