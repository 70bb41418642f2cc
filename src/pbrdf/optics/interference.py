"""Two-beam interference in a thin film, by which flakes change their colour with the angle.

The rays reflected at both faces of a film of index n_f and thickness d differ in phase by δ = 4π (n_f d/λ) cosβ_f with
sinβ = n_f sinβ_f (Born and Wolf, *Principles of Optics*, chapter 7); several beams, dispersion, and what the film
does to the polarisation are left out.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from pbrdf.optics.phases import cos_of_turns, in_double

__all__ = ["two_beam_interference"]


def two_beam_interference(cos_beta: Any, order: Any, visibility: Any, index: Any) -> Any:
    """(1 + V cos δ)/(1 + V) with δ = 2π m cosβ_f, at most 1.

    Parameters
    ----------
    cos_beta
        Cosine of the angle of incidence outside the film.
    order
        m = 2 n_f d/λ, order of the interference at normal incidence; it need not be whole.
    visibility
        V within 0 … 1, contrast of the fringes.
    index
        n_f ≥ 1.
    """
    cos, n = in_double(cos_beta), in_double(index)
    sin2 = dr.maximum(1.0 - cos * cos, 0.0)
    fringe = cos_of_turns(in_double(order) * dr.sqrt(1.0 - sin2 / (n * n)))
    Float: Any = dr.expr_t(cos_beta, order, index)
    return (1.0 + visibility * Float(fringe)) / (1.0 + visibility)
