"""How much light facets that are perfect mirrors reflect: the directional-hemispherical reflectance for |r| = 1.

Facets of Gaussian slopes with V-cavity shadowing, light that meets one facet. What is missing to 1 meets several, or
is lost in the model. There is no closed form: a product of Chebyshev polynomials in σ and in z = σ tanθ/(σ tanθ + ½),
which
``scripts/make_mirror_reflectance.py`` fits to the integral; largest error 9e-4.
"""

from __future__ import annotations

from typing import Any

__all__ = ["mirror_reflectance"]

_TABLE = (
    (
        0.780064, -0.260774, -0.040123, 0.028347, 0.001655, -0.006127, 0.001683,
        0.000921, -0.000917, 0.000179, 0.000168, -0.000173, 5.2e-05,
    ),
    (
        0.171376, 0.222446, 0.009833, -0.040102, 0.002861, 0.009189, -0.003721,
        -0.001149, 0.001674, -0.000453, -0.000265, 0.000337, -0.000111,
    ),
    (
        0.068993, 0.062016, 0.027225, 0.004618, -0.006782, -0.002331, 0.003003,
        -0.000126, -0.001045, 0.000534, 9.7e-05, -0.000259, 0.000117,
    ),
    (
        -0.004181, -0.009995, 0.014588, 0.009906, -0.000455, -0.001968, -0.000361,
        0.00063, 0.000117, -0.000337, 6.8e-05, 0.000105, -9e-05,
    ),
    (
        -0.018065, -0.012346, -0.006454, 0.000824, 0.003993, 0.000634, -0.001345,
        -3e-05, 0.000385, -5.2e-05, -9.9e-05, 3.6e-05, 1.8e-05,
    ),
    (
        -0.003441, -0.005625, -0.008139, -0.002741, 0.00044, 0.001037, 0.000482,
        -0.00051, -0.000151, 0.000244, -2.5e-05, -7.6e-05, 4.6e-05,
    ),
    (
        0.004313, 0.000283, 1e-06, -0.00246, -0.001777, 0.000286, 0.000541,
        7.5e-05, -0.00016, -7.2e-05, 9.6e-05, 1.3e-05, -4.6e-05,
    ),
    (
        0.001832, 0.004151, 0.002654, 0.000194, -0.000827, -0.000742, 1.3e-05,
        0.000339, -4e-06, -0.000102, 3e-06, 3.8e-05, 4e-06,
    ),
    (
        -0.000327, 0.001827, 0.001325, 0.00162, 0.000395, -0.000477, -0.000305,
        1.4e-05, 0.000154, 5e-06, -7.2e-05, 2e-06, 1.6e-05,
    ),
    (
        -0.000317, -0.001343, -3.3e-05, 0.000565, 0.000729, 0.000292, -0.000243,
        -0.000176, 6.1e-05, 7.5e-05, -7e-06, -3.5e-05, 2e-06,
    ),
    (
        -0.000306, -0.001002, -0.0008, -0.000476, 0.000196, 0.000388, 0.000137,
        -0.00012, -0.000115, 4.2e-05, 4.8e-05, -9e-06, -8e-06,
    ),
    (
        -0.00014, 8.3e-05, -0.000464, -0.000457, -0.000345, 3.9e-05, 0.000238,
        6.1e-05, -8.6e-05, -6.1e-05, 2.8e-05, 2.6e-05, -1.6e-05,
    ),
    (
        0.000143, 0.000186, 0.000221, -5.8e-05, -0.000252, -0.000211, 1e-06,
        0.000143, 5.2e-05, -5.8e-05, -3.8e-05, 1.4e-05, 1.3e-05,
    ),
    (
        9.4e-05, 0.000114, 0.000223, 0.000183, 6.4e-05, -0.000122, -0.000132,
        9e-06, 8.5e-05, 3.2e-05, -3.5e-05, -1.3e-05, 1.6e-05,
    ),
    (
        -2.7e-05, 2.9e-05, -1.9e-05, 0.000106, 0.000127, 6.4e-05, -6e-05,
        -9.5e-05, 0, 5.8e-05, 2.6e-05, -1.8e-05, -9e-06,
    ),
)  # fmt: skip


def mirror_reflectance(cos_theta: Any, sin_theta: Any, sigma: Any) -> Any:
    """∫ f00 cosθ_r dω_r of Gaussian facets with |r| = 1 and V-cavity shadowing.

    Parameters
    ----------
    cos_theta, sin_theta
        Of the zenith angle of the source.
    sigma
        Standard deviation of one slope component, at most 1.
    """
    steep = sigma * sin_theta
    z = steep / (steep + 0.5 * cos_theta)
    s = 2.0 * sigma - 1.0
    return _chebyshev(2.0 * z - 1.0, [_chebyshev(s, row) for row in _TABLE])


def _chebyshev(x: Any, coefficients: Any) -> Any:
    """Σ c_j T_j(x) by Clenshaw's recurrence."""
    double = 2.0 * x
    last: Any = 0.0
    current: Any = coefficients[-1]
    for c in reversed(coefficients[1:-1]):
        last, current = current, double * current - last + c
    return x * current - last + coefficients[0]
