"""How much light facets that are perfect mirrors reflect: the directional-hemispherical reflectance for |r| = 1.

Facets of Gaussian slopes with V-cavity shadowing, light that meets one facet. What is missing to 1 meets several, or
is lost in the model. There is no closed form: a product of Chebyshev polynomials in σ and in z = σ tanθ/(σ tanθ + ½),
which
``scripts/make_mirror_reflectance.py`` fits to the integral; largest error 8e-4.
"""

from __future__ import annotations

from typing import Any

__all__ = ["LARGEST_SIGMA", "mirror_reflectance"]

#: The table ends here.
LARGEST_SIGMA = 0.6
_TABLE = (
    (0.899161, -0.119, -0.041469, 0.000629, 0.004886, -6e-06, -0.000892, 0.000131, 0.000184),
    (0.078103, 0.128866, 0.044658, -0.00441, -0.00776, 0.000512, 0.001546, -0.000316, -0.000328),
    (0.033412, 0.005942, 0.001053, 0.004669, 0.003189, -0.000985, -0.000892, 0.000352, 0.00021),
    (-0.004294, -0.020673, -0.004553, 0.000652, 0.000435, 0.000485, 0.000144, -0.000227, -5.4e-05),
    (-0.009641, 0.001612, -0.00054, -0.002306, -0.001019, 0.000313, 0.000227, 0.0, -4.7e-05),
    (0.001329, 0.004839, 0.000195, 0.000203, 0.000122, -0.00046, -0.00013, 0.000141, 4.2e-05),
    (0.003412, -0.001026, 0.001204, 0.000904, 9.5e-05, 1.5e-05, -3.6e-05, -8.8e-05, 1.1e-05),
    (-0.000957, -0.000745, -6.9e-05, -0.000107, 0.000168, 0.000201, -7e-06, -2.9e-05, -2e-05),
    (-0.001194, 0.000105, -0.000837, -0.000302, -1.6e-05, -1.7e-05, 7.7e-05, 4.2e-05, -1.2e-05),
    (0.000562, -0.000156, 0.000127, -8.8e-05, -0.000204, -7e-05, -1e-06, 1.1e-05, 1.9e-05),
    (0.000361, 0.000308, 0.000385, 0.000133, 3.3e-05, -3.6e-05, -6.4e-05, -1.1e-05, 6e-06),
    (-0.000229, 0.00016, -4.1e-05, 0.000142, 0.000131, 3.7e-05, 7e-06, -2.1e-05, -1.2e-05),
    (-0.0001, -0.000319, -0.000149, -9e-05, -1.1e-05, 5.5e-05, 3.8e-05, 7e-06, -5e-06),
    (4.9e-05, -4.6e-05, -4.1e-05, -0.000106, -7.6e-05, -3e-05, 5e-06, 2.2e-05, 7e-06),
    (4.4e-05, 0.000188, 7e-05, 5.3e-05, -1.4e-05, -4.6e-05, -2.7e-05, -8e-06, 8e-06),
)  # fmt: skip


def mirror_reflectance(cos_theta: Any, sin_theta: Any, sigma: Any) -> Any:
    """∫ f00 cosθ_r dω_r of Gaussian facets with |r| = 1 and V-cavity shadowing.

    Parameters
    ----------
    cos_theta, sin_theta
        Of the zenith angle of the source.
    sigma
        Standard deviation of one slope component, at most :data:`LARGEST_SIGMA`.
    """
    steep = sigma * sin_theta
    z = steep / (steep + 0.5 * cos_theta)
    s = sigma * (2.0 / LARGEST_SIGMA) - 1.0
    return _chebyshev(2.0 * z - 1.0, [_chebyshev(s, row) for row in _TABLE])


def _chebyshev(x: Any, coefficients: Any) -> Any:
    """Σ c_j T_j(x) by Clenshaw's recurrence."""
    double = 2.0 * x
    last: Any = 0.0
    current: Any = coefficients[-1]
    for c in reversed(coefficients[1:-1]):
        last, current = current, double * current - last + c
    return x * current - last + coefficients[0]
