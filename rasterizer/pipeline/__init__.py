"""Kernels over plain arrays, in the order in which a triangle passes through them. No scene is known here.

    transform           stage 1: vertices to 1/256 px, and 38 bits of depth
    clip                stage 2: triangles with a vertex that has no place on the screen
    cull                stages 3 and 4: triangles that can cover a sample, sorted into bands of rows
    setup               stage 5: boxes, slopes and planes of depth, 64 triangles side by side
    gradients           the same of what is interpolated, and whether it is good enough
    visibility          the visibility buffer: depth above an intensity or a setup's number, packed, for each sample
    cut_outs            samples that are not there, by the alpha of a texture
    triangle_setups     what triangles leave that are shaded later: planes, or their corners
    scan                edges, spans and small boxes, into the visibility buffer
    shade               stage 6: intensities of the visible samples; flat shading and Gouraud's method
    phong_shading       the same by Phong's method: samples are lit
    resolve             stage 7: samples to pixels to bytes
    buffers             stage 7 of exact buffers: depth, face, normal and the others

What stage 6 uses:

    fragments           the batch of samples that are lit together
    samples             the planes of setups at samples
    interpolate         exact interpolation over the triangles of exact setups
    lighting            the illumination equation, at the one place where it is evaluated
    lights              its lights: a function for each type
    shadow_lookup       which part of a light arrives
    reflection          its reflection models: a function for each
    material_coefficients    where each coefficient stands in a material's row
    power               powers of cosines
    textures            textures as arrays, and the planes of their coordinates
    texcoords           where the samples of a batch lie in them, and mip levels
    texture_lookup      what they show there
    texturing           both, at a run of samples
    a_buffer            lists of transparent fragments, and what is seen through them
    edges               drawn edges: how much of each sample they cover
    ground              how many points of an area light each texel of the ground doesn't see
    ground_picture      the shadow of the ground, laid under a picture

And around it all: the workspace that each draws a band in, and intrinsics, inner loops as vector instructions.
"""
