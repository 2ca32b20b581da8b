"""Joins a scene with the pipeline: the only folder that sees both. Read draw.py first.

    draw                the line of all stages, from transform to the picture, and what is counted and timed of them
    passes              what is drawn: a picture, exact buffers, a shadow map
    transparency        bands that show transparent surfaces
    prepared            a scene prepared for drawing, what is kept from picture to picture, and whether memory is there

What is known before the first stage, in the order in which it is made:

    scene_tables        the scene as tables: materials, lights, the tint
    texture_tables      textures: in 16 bits with mip levels, and those that are looked up in float64
    domains             where float32 is enough, and what is stated of a picture
    plan                what this scene needs, and nothing else: types, channels and paths of its materials; in words
    points              all meshes of a scene as one set of arrays: what pictures are drawn from
    recorded_kernels    the kernels that pictures call, each with its signature: what is compiled ahead
    depth_range         depths that are seen or clipped, and the z-buffer fitted to them
    uniforms            the plan as arrays: lights and materials for one view, what packed samples and setups hold
    lit_points          light of vertices and centroids, where that is what is interpolated
    shadow_maps         pictures of the scene as the lights see it

Tables that take an entry for each type, also those of your own (registries.py):

    lights              what the engine asks of each type of light
    reflections         what it asks of each reflection model
    buffers             what it asks of each output buffer

What is drawn beside a picture:

    edges               edges over a picture
    ground_shadow       the soft shadow on the ground under a scene
    sample_path         how one sample of a picture was drawn
    point_lighting      the illumination equation at points, without a picture; one light, one reflection model
"""
