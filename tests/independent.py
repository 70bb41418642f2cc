"""Independent reference physics for the tests: plain NumPy and SciPy, nothing imported from ``pbrdf``.

Written from MODEL.md and LITERATURE.md with other formulas than the package's wherever there is a choice:
explicit angles and rotation matrices for the specular part, Jones matrices for the vector form, complex
Fresnel coefficients, polar coordinates in slope space with tanh-sinh nodes for the facet averages.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy import special

PARAMETERS = ("sigma", "n", "kappa", "a", "k", "b", "t")
#: Parameter bounds for fitting, MODEL section 5; κ up to what metals have.
LOWER = {"sigma": 0.002, "n": 1.2, "kappa": 0.0, "a": 0.05, "k": 0.3, "b": -3.0, "t": 0.0}
UPPER = {"sigma": 0.6, "n": 2.6, "kappa": 4.0, "a": 5.0, "k": 4.0, "b": 4.0, "t": 1.0}


# --- geometry --------------------------------------------------------------------------------------


def rays(theta_i, theta_r, phi):
    """ω_i, ω_r as arrays (..., 3), MODEL section 1."""
    theta_i, theta_r, phi = np.broadcast_arrays(theta_i, theta_r, phi)
    w_i = np.stack([-np.sin(theta_i), 0 * theta_i, np.cos(theta_i)], -1)
    w_r = np.stack([np.sin(theta_r) * np.cos(phi), np.sin(theta_r) * np.sin(phi), np.cos(theta_r)], -1)
    return w_i, w_r


def frames(theta_i, theta_r, phi):
    """(p_i, s_i, p_r, s_r) from s = k×ẑ/|k×ẑ|, p = s×k; the rays must not run along ẑ."""
    w_i, w_r = rays(theta_i, theta_r, phi)
    out = []
    for k in (-w_i, w_r):
        s = np.cross(k, [0.0, 0.0, 1.0])
        s = s / np.linalg.norm(s, axis=-1, keepdims=True)
        out += [np.cross(s, k), s]
    return out


def explicit_angles(theta_i, theta_r, phi):
    """β, θ, α1, α2 by the trigonometry of LITERATURE 1.1."""
    cos_w = -np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    beta = 0.5 * (np.pi - np.arccos(np.clip(cos_w, -1, 1)))
    cos_theta = (np.cos(theta_i) + np.cos(theta_r)) / (2 * np.cos(beta))
    a1 = np.arctan2(
        np.sin(theta_r) * np.sin(phi),
        np.cos(theta_r) * np.sin(theta_i) + np.sin(theta_r) * np.cos(theta_i) * np.cos(phi),
    )
    a2 = np.arctan2(
        np.sin(theta_i) * np.sin(phi),
        np.sin(theta_r) * np.cos(theta_i) + np.cos(theta_r) * np.sin(theta_i) * np.cos(phi),
    )
    return beta, np.arccos(np.clip(cos_theta, -1, 1)), a1, a2


# --- Mueller algebra -------------------------------------------------------------------------------


def paper_rotation(alpha):
    """M(α) of eq. (5)."""
    c, s = np.cos(2 * np.asarray(alpha)), np.sin(2 * np.asarray(alpha))
    M = np.zeros((*c.shape, 4, 4))
    M[..., 0, 0] = M[..., 3, 3] = 1
    M[..., 1, 1], M[..., 1, 2], M[..., 2, 1], M[..., 2, 2] = c, -s, s, c
    return M


#: Stokes vector (I, Q, U, V) from (E_p E_p*, E_p E_s*, E_s E_p*, E_s E_s*): V = 2 Im(E_p E_s*).
_STOKES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -1j, 1j, 0]])


def mueller_from_jones(J):
    """Mueller matrix of a Jones matrix (..., 2, 2) over (p, s), for the sign of V of eq. (6)."""
    J = np.asarray(J, dtype=complex)
    kron = np.einsum("...ij,...kl->...ikjl", J, J.conj()).reshape(*J.shape[:-2], 4, 4)
    return (_STOKES @ kron @ np.linalg.inv(_STOKES)).real


def coherency_eigenvalues(M):
    """Eigenvalues (ascending) of Cloude's coherency matrix of Mueller matrices (..., 4, 4)."""
    M = np.asarray(M)
    # through the Jones picture: a sum of Jones matrices with non-negative weights has H >= 0
    kron = np.linalg.inv(_STOKES) @ M @ _STOKES
    H = kron.reshape(*M.shape[:-2], 2, 2, 2, 2)  # indices i k j l of J_ij J*_kl
    H = np.moveaxis(H, (-4, -3, -2, -1), (-4, -2, -3, -1)).reshape(*M.shape[:-2], 4, 4)
    return np.linalg.eigvalsh(0.5 * H)


# --- Fresnel ---------------------------------------------------------------------------------------


def fresnel_r(beta, n):
    """r_p, r_s of eqs (7)-(8); n complex as n − iκ."""
    n = np.asarray(n, dtype=complex)
    c = np.cos(beta)
    ct = np.sqrt(1 - (np.sin(beta) / n) ** 2)
    return (n * c - ct) / (n * c + ct), (c - n * ct) / (c + n * ct)


def fresnel_t_out(beta, n):
    """t_p, t_s from inside the coating to air, β the angle outside (LITERATURE 3e)."""
    n = np.asarray(n, dtype=complex)
    c = np.cos(beta)
    ct = np.sqrt(1 - (np.sin(beta) / n) ** 2)
    return 2 * n * ct / (ct + n * c), 2 * n * ct / (n * ct + c)


def transmittance(beta, n, kind):
    """T_p, T_s: 1 − |r|² or |t|²."""
    r = fresnel_r(beta, n) if kind == "flux" else fresnel_t_out(beta, n)
    return tuple(1 - abs(x) ** 2 if kind == "flux" else abs(x) ** 2 for x in r)


def external_diffuse_reflectance(n):
    """Share of diffuse light that a flat dielectric reflects, closed form (Walsh 1926; Duntley, JOSA 32, 61 (1942))."""
    return (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + n**2 * (n**2 - 1) ** 2 / (n**2 + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (n**2 + 2 * n - 1) / ((n**2 + 1) * (n**4 - 1))
        + 8 * n**4 * (n**4 + 1) / ((n**2 + 1) * (n**4 - 1) ** 2) * np.log(n)
    )


# --- specular part ---------------------------------------------------------------------------------


def mirror_mueller(beta, n):
    """M_r of eq. (6) as printed (with the repaired sign of M43)."""
    r_p, r_s = fresnel_r(beta, n)
    z = r_p * np.conj(r_s)
    M = np.zeros((*z.shape, 4, 4))
    M[..., 0, 0] = M[..., 1, 1] = 0.5 * (abs(r_p) ** 2 + abs(r_s) ** 2)
    M[..., 0, 1] = M[..., 1, 0] = 0.5 * (abs(r_p) ** 2 - abs(r_s) ** 2)
    M[..., 2, 2] = M[..., 3, 3] = z.real
    M[..., 2, 3], M[..., 3, 2] = -z.imag, z.imag
    return M


def smith_lambda(theta, sigma):
    """Λ = ½[√(2/π) (σ/ν) exp(−ν²/2σ²) − erfc(ν/√2σ)], ν = cotθ."""
    nu = 1 / np.tan(theta)
    gauss = np.sqrt(2 / np.pi) * sigma / nu * np.exp(-(nu**2) / (2 * sigma**2))
    return 0.5 * (gauss - special.erfc(nu / (np.sqrt(2) * sigma)))


def shadowing(theta_i, theta_r, theta, beta, sigma, kind):
    if kind == "none":
        return np.ones_like(beta)
    if kind == "smith":
        return 1 / (1 + smith_lambda(theta_i, sigma) + smith_lambda(theta_r, sigma))
    i, r = (2 * np.cos(theta) * np.cos(x) / np.cos(beta) for x in (theta_i, theta_r))
    return np.minimum(1, np.minimum(i, r))


def specular(theta_i, theta_r, phi, sigma, n, shadow="v-cavity"):
    """Eqs (2)-(8) by explicit angles: f_mf = P G M(−α2) M_r M(α1)/(4 cosθ cosθ_i cosθ_r)."""
    theta_i, theta_r, phi, sigma, n = np.broadcast_arrays(theta_i, theta_r, phi, sigma, n)
    beta, theta, a1, a2 = explicit_angles(theta_i, theta_r, phi)
    P = np.exp(-(np.tan(theta) ** 2) / (2 * sigma**2)) / (2 * np.pi * sigma**2 * np.cos(theta) ** 3)
    G = shadowing(theta_i, theta_r, theta, beta, sigma, shadow)
    scale = P * G / (4 * np.cos(theta) * np.cos(theta_i) * np.cos(theta_r))
    M = paper_rotation(-a2) @ mirror_mueller(beta, n) @ paper_rotation(a1)
    return scale[..., None, None] * M


# --- averages over facets --------------------------------------------------------------------------


def tanh_sinh(step=0.04, reach=3.3):
    """Nodes as distances from the nearer end, and weights, on (0, 1): (from the left, from the right, w)."""
    z = np.arange(-round(reach / step), round(reach / step) + 1) * step
    u = np.pi * np.sinh(z)
    left, right = special.expit(u), special.expit(-u)
    return left, right, step * np.pi * np.cosh(z) * left * right


def slope_nodes(theta_i, theta_r, phi, sigma, step=0.05, far=9.5):
    """Facets m (N, 3), μ_i', μ_r' and weights w (N,) with Σ w g(m) = ∫ P g dω over the lit and seen facets.

    One geometry. Polar coordinates (r, ψ) in slopes over σ: lit is r cosψ < c_i, seen is −r cos(ψ − φ) < c_r.
    The ψ integral is split at every direction where the limiting edge changes; near an edge the local
    cosine comes from the node's distance to it, without cancellation.
    """
    tangents = np.tan(theta_i), np.tan(theta_r)
    cosines = np.cos(theta_i), np.cos(theta_r)
    c = [1 / max(t * sigma, 1e-9) for t in tangents]
    directions = (0.0, phi + np.pi)
    cuts = [0.0, 2 * np.pi]
    for distance, direction in zip(c, directions, strict=True):
        cuts += [direction, direction + np.pi / 2, direction - np.pi / 2]
        if distance < far:
            cuts += [direction + np.arccos(distance / far), direction - np.arccos(distance / far)]
    # corner: c_r cos(ψ − d_i) = c_i cos(ψ − d_r)
    corner = np.arctan2(c[0] * np.cos(directions[1]) - c[1], -c[0] * np.sin(directions[1]))
    cuts = np.unique(np.round(np.mod([*cuts, corner, corner + np.pi], 2 * np.pi), 14))
    cuts = np.append(cuts, 2 * np.pi) if cuts[-1] < 2 * np.pi - 1e-12 else cuts
    left, right, weight = tanh_sinh(step)
    found = []
    for low, high in itertools.pairwise(cuts):
        psi = np.where(left < 0.5, low + (high - low) * left, high - (high - low) * right)
        reach = np.full((2, psi.size), np.inf)
        for j in (0, 1):
            across = np.cos(psi - directions[j])
            reach[j] = np.where(across > 0, c[j] / np.maximum(across, 1e-30), np.inf)
        radius = np.minimum(reach.min(0), far)
        r = radius[:, None] * left[None, :]
        w = r * np.exp(-0.5 * r * r) / (2 * np.pi) * radius[:, None] * weight[None, :]
        w = w * ((high - low) * weight)[:, None]
        slopes = sigma * r[..., None] * np.stack([np.cos(psi), np.sin(psi)], -1)[:, None, :]
        inverse = 1 / np.sqrt(1 + (slopes**2).sum(-1))
        m = np.concatenate([slopes, np.ones((*r.shape, 1))], -1) * inverse[..., None]
        mu = []
        for j in (0, 1):
            plain = 1 - r * np.cos(psi - directions[j])[:, None] / c[j]
            finite = np.isfinite(reach[j])[:, None]
            reach_j = np.where(finite[:, 0], np.minimum(reach[j], 1e12), 1.0)[:, None]
            edge = (reach_j - radius[:, None] + radius[:, None] * right) / reach_j
            mu.append(cosines[j] * inverse * np.where(finite, edge, plain))
        found.append([x.reshape(r.size, -1) for x in (m, *mu, w)])
    m, mu_i, mu_r, w = (np.concatenate(x) for x in zip(*found, strict=True))
    keep = (mu_i[:, 0] > 0) & (mu_r[:, 0] > 0)
    return m[keep], mu_i[keep, 0], mu_r[keep, 0], w[keep, 0]


def shape(mu_i, mu_r, k):
    """W = [(μ_r + μ_i) μ_r μ_i]^(k−1)."""
    return ((mu_r + mu_i) * mu_r * mu_i) ** (k - 1.0)


def exit_column(m, theta_i, theta_r, phi, n, kind, ray="r"):
    """First column (I, Q, U) of R M_t D_s for facets m (N, 3): T_+ and T_− along the facet's p direction."""
    p_i, s_i, p_r, s_r = surface_frames(theta_i, theta_r, phi)
    w_i, w_r = rays(theta_i, theta_r, phi)
    k, p, s, w = (w_r, p_r, s_r, w_r) if ray == "r" else (-w_i, p_i, s_i, w_i)
    cos_beta = np.clip(m @ w, 0, 1)
    T_p, T_s = transmittance(np.arccos(cos_beta), n, kind)
    s_m = np.cross(k, m)
    length = np.linalg.norm(s_m, axis=-1, keepdims=True)
    p_m = np.cross(s_m / np.maximum(length, 1e-300), k)
    cos_chi, sin_chi = p_m @ p, p_m @ s
    mean, half = 0.5 * (T_p + T_s), 0.5 * (T_p - T_s)
    return np.stack([mean, half * (cos_chi**2 - sin_chi**2), half * 2 * cos_chi * sin_chi], -1)


def surface_frames(theta_i, theta_r, phi):
    """(p, s) of both rays with their limits along the normal."""
    return (
        np.array([np.cos(theta_i), 0, np.sin(theta_i)]),
        np.array([0.0, -1.0, 0.0]),
        np.array([-np.cos(theta_r) * np.cos(phi), -np.cos(theta_r) * np.sin(phi), np.sin(theta_r)]),
        np.array([np.sin(phi), -np.cos(phi), 0.0]),
    )


def visible_integrals(theta_i, theta_r, phi, k, step=0.035):
    """∫dω and ∫W dω over the lit and seen facets of the upper hemisphere, from raw vectors.

    Product tanh-sinh rule, m = cosλ (cosψ e1 + sinψ e2) + sinλ e3 with e3 along ω_i×ω_r; W is computed
    from m·ω_i and m·ω_r, given near the edges by the node's distance from the edge (no cancellation).
    """
    w_i, w_r = rays(theta_i, theta_r, phi)
    e3 = np.cross(w_i, w_r)
    e3 = e3 / np.linalg.norm(e3) if np.linalg.norm(e3) > 1e-12 else np.array([0.0, 1.0, 0.0])
    e1 = (w_i + w_r) / np.linalg.norm(w_i + w_r)
    e2 = np.cross(e3, e1)
    half = 0.5 * np.arctan2(np.linalg.norm(np.cross(w_i, w_r)), w_i @ w_r)
    limit = np.pi / 2 - half
    # W integrates over ψ ∈ (−limit, limit); at given ψ the horizon cuts the lune at one λ
    root = np.arctan2(-e1[2], e2[2])  # cosψ e1z + sinψ e2z = 0
    cuts = [-limit, limit, *(x for x in (root, root + np.pi, root - np.pi) if -limit < x < limit)]
    cuts = np.sort(cuts)
    left, right, weight = tanh_sinh(step, 3.6)
    area = total = 0.0
    for low, high in itertools.pairwise(cuts):
        psi = low + (high - low) * left
        from_low = (high - low) * left + (low + limit)  # ψ + limit
        from_high = (high - low) * right + (limit - high)  # limit − ψ
        g = np.cos(psi) * e1[2] + np.sin(psi) * e2[2]
        horizon = np.arctan2(-g, e3[2]) if e3[2] > 0 else -np.arctan2(-g, -e3[2])
        # above the horizon: cosλ g + sinλ e3z > 0
        up = e3[2] > 0
        lower = horizon if up else np.full_like(psi, -np.pi / 2)
        upper = np.full_like(psi, np.pi / 2) if up else horizon
        width = (upper - lower)[:, None]
        from_lower = width * left + (lower + np.pi / 2)[:, None]
        from_upper = width * right + (np.pi / 2 - upper)[:, None]
        cos_lambda = np.sin(np.minimum(from_lower, from_upper))
        # m·ω_i = cosλ cos(ψ + half) = cosλ sin(limit − ψ), m·ω_r = cosλ sin(limit + ψ); ω_i lies at ψ = −half
        mu_i = cos_lambda * np.sin(from_high)[:, None]
        mu_r = cos_lambda * np.sin(from_low)[:, None]
        cell = cos_lambda * width * weight * ((high - low) * weight)[:, None]
        area += cell.sum()
        total += (cell * shape(np.maximum(mu_i, 1e-300), np.maximum(mu_r, 1e-300), k)).sum()
    return area, total


def diffuse_column(theta_i, theta_r, phi, p, normalization="weighted", kind="flux", step=0.05):
    """f_rpv [(1−t) D_s + t D_v], first column (I, Q, U); ``p`` a dict of the parameters."""
    n = p["n"] - 1j * p["kappa"]
    m, mu_i, mu_r, w = slope_nodes(theta_i, theta_r, phi, p["sigma"], step)
    W = shape(mu_i, mu_r, p["k"])
    column = exit_column(m, theta_i, theta_r, phi, n, kind)
    numerator = (w * W) @ column
    if normalization == "weighted":
        D_v = numerator / (w @ W)
    else:
        area, integral = visible_integrals(theta_i, theta_r, phi, p["k"])
        D_v = numerator * area / integral
    cos_w = -np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    f_rpv = p["a"] / np.pi * shape(np.cos(theta_i), np.cos(theta_r), p["k"]) * np.exp(p["b"] * cos_w)
    return f_rpv * ((1 - p["t"]) * np.array([1.0, 0, 0]) + p["t"] * D_v)


def reciprocal_block(theta_i, theta_r, phi, p, step=0.05):
    """f_rpv [(1−t) D_s + t E[W T_out D_s T_in]/E[W]], the 3 x 3 block (I, Q, U)."""
    n = p["n"] - 1j * p["kappa"]
    m, mu_i, mu_r, w = slope_nodes(theta_i, theta_r, phi, p["sigma"], step)
    W = shape(mu_i, mu_r, p["k"])
    out = exit_column(m, theta_i, theta_r, phi, n, "flux")
    enter = exit_column(m, theta_i, theta_r, phi, n, "flux", ray="i")
    D_b = np.einsum("n,ni,nj->ij", w * W, out, enter) / (w @ W)
    cos_w = -np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    f_rpv = p["a"] / np.pi * shape(np.cos(theta_i), np.cos(theta_r), p["k"]) * np.exp(p["b"] * cos_w)
    D_s = np.zeros((3, 3))
    D_s[0, 0] = 1
    return f_rpv * ((1 - p["t"]) * D_s + p["t"] * D_b)


# --- closed forms ----------------------------------------------------------------------------------


def diffuse_dolp(theta, n):
    """DoLP of light transmitted out of a smooth dielectric (Atkinson and Hancock), MODEL section 6."""
    s2 = np.sin(theta) ** 2
    root = np.sqrt(n**2 - s2)
    return (n - 1 / n) ** 2 * s2 / (2 + 2 * n**2 - (n + 1 / n) ** 2 * s2 + 4 * np.cos(theta) * root)


def wedge_probability(c_i, c_r, phi):
    """Gaussian probability of x < c_i and −(x cosφ + y sinφ) < c_r, by Owen's T function; c > 0."""
    rho = -np.cos(phi)
    root = np.sqrt(np.maximum(1 - rho**2, 1e-300))
    cdf = special.ndtr
    t_i = special.owens_t(c_i, (c_r / c_i - rho) / root)
    t_r = special.owens_t(c_r, (c_i / c_r - rho) / root)
    return 0.5 * (cdf(c_i) + cdf(c_r)) - t_i - t_r


def dolp(f):
    """DoLP under natural light of Mueller matrices (..., 4, 4)."""
    return np.hypot(f[..., 1, 0], f[..., 2, 0]) / f[..., 0, 0]


def random_case(rng, size, *, kappa="some", theta_max=89.9, **limits):
    """Random parameters in bounds and random angles, as two dicts of arrays of length ``size``."""
    p = {}
    for name in PARAMETERS:
        low, high = limits.get(name, (LOWER[name], UPPER[name]))
        u = rng.random(size)
        p[name] = low * (high / low) ** u if name in ("sigma", "a") else low + (high - low) * u
    if kappa == "some":
        p["kappa"] *= rng.random(size) < 0.5
    elif kappa == "none":
        p["kappa"] *= 0
    top = np.radians(theta_max)
    g = {
        "theta_i": top * rng.random(size),
        "theta_r": top * rng.random(size),
        "phi": np.pi * (2 * rng.random(size) - 1),
    }
    return p, g
