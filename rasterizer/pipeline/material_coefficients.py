"""Where the coefficients of a material stand in its row: those of its reflection function, then its colours.

A row is written by engine/uniforms.py, and read by the reflection functions (reflection.py) and by lighting.py. Import
it qualified: `from . import material_coefficients as m`, then `material[m.SHININESS]`.
"""

SHININESS = 0
ROUGHNESS = 1  # of anisotropic materials: along the tangent
HAS_FRESNEL = 2  # 1 where a highlight is weighted by W(θ), else 0
HIGHLIGHT_SCALE = 3  # of a normalised highlight, beside N·L; 0 for a classic one
TOON_LEVELS = 4
ROUGHNESS_ACROSS = 5  # of anisotropic materials: across the tangent
TANGENT_AXIS = 6  # of anisotropic materials whose tangent is an axis of the world: three numbers
METALLIC = 9  # share of the surface that is metal, where a texture multiplies it
OWN_NUMBERS = 5  # of models of one's own, which are neither anisotropic nor metal: up to N_OWN_NUMBER
N_OWN_NUMBER = 5
N_REFLECTION_COEFFICIENT = 10
REFLECTION_SHAPE = (N_REFLECTION_COEFFICIENT,)
# Colours, three channels each. AMBIENT is ka·Ia.
EMISSION, AMBIENT, DIFFUSE, SPECULAR = (N_REFLECTION_COEFFICIENT + 3 * k for k in range(4))
N_MATERIAL_COEFFICIENT = N_REFLECTION_COEFFICIENT + 12
