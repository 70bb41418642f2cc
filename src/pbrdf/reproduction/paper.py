"""What the paper prints: its samples, its simulation (figure 3) and the numbers of its measured data.

The measured numbers stand in the report beside ours for orientation only. They are errors of the model against real
paints; ours are errors against data that the model itself has made.
"""

from __future__ import annotations

from pbrdf.data.paints import PAINTS

__all__ = [
    "DIFFUSE_ERRORS",
    "DOP_STD",
    "FIGURE_3_INCIDENCE",
    "FIGURE_3_PARAMETERS",
    "INTENSITY_MAX",
    "INTENSITY_STD",
    "PAPER",
    "SAMPLES",
    "SIMULATED",
    "SPECULAR_ERRORS",
]

PAPER = "Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017)"
#: Stands on every page, figure and file.
SIMULATED = "SIMULATED data: the paper published no raw data"

#: The samples in the paper's order: name of the bundled paint, and what the paper calls it.
SAMPLES: dict[str, str] = dict(
    zip(
        PAINTS,
        ("white", "matte white, thin", "matte white, thick", "pearl white", "back of a CD"),
        strict=True,
    )
)

#: σ, n, a, k, b, t and angle of incidence (degrees) of the paper's figure 3.
FIGURE_3_PARAMETERS = (0.1, 2.0 - 1.5j, 3.0, 2.0, 1.0, 0.5)
FIGURE_3_INCIDENCE = 35.0

#: Sample 3, section 2.3: standard deviation (digital numbers) and largest size (relative) of the intensity's error, and
#: standard deviation of the error of the degree of polarisation.
INTENSITY_STD, INTENSITY_MAX, DOP_STD = 4.0, 0.17, 0.028
#: Errors "at the strongest diffuse point" and "at the strongest specular point", positions 1, 2, 3. They stand in the
#: paragraph on the degree of polarisation of sample 3, so that is probably what they are errors of.
DIFFUSE_ERRORS, SPECULAR_ERRORS = (0.20, 0.13, 0.38), (0.001, 0.016, 0.03)
