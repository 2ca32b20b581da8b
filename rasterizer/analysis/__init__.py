"""What pictures and models are worth: measured, compared and laid beside each other.

In:  frames or arrays, scenes, meshes        Out: numbers in records, one picture of several, texts

    comparison          how far two pictures are apart: in linear light, in levels, as eyes see it
    contact_sheet       several pictures on one sheet
    pixel               why a pixel has its value, as the reference explains it
    mach                how much the polygons show: Mach bands
    mesh_topology       whether triangles close a volume, how many bodies they are
    speed_error         what each method costs, and how far its picture is from the ground truth
    speed_error_plot    the plot of that, and what all plots share
    timing              calls that are timed in turns, and the machine they ran on
"""
