"""Files to scenes, and pictures and arrays to files.

A format's reader is one file; loader.py is where reading begins.

    loader              load: files of every format, and whatever is a mesh already
    formats             the table of formats, and who reads each
    files               which files may be read, and how they are written
    model_file          what the readers of models share: numbers in text, how much may be made of a file
    obj, mtl            OBJ, and its materials
    ply, stl, off, gltf PLY; STL; OFF; glTF and GLB
    dae                 COLLADA, by pycollada
    threemf             3MF, by lib3mf
    other_formats       what trimesh reads: 3DXML and XAML
    text_kernels        numbers in long texts, and corners in OBJ: compiled
    scene_file          a whole scene in a JSON file
    scene_file_write    save: the same, written
    camera_file         a camera out of one, or of a file of its own
    png                 PNG files
    array_files         arrays: .npy, .npz, PNG with a stated scale, EXR
    animation           moving pictures: GIF, WebP, APNG, MP4
"""
