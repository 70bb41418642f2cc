// The double-Gauss pBRDF as a straightforward C++ program: one loop over the directions, loops over the facets
// inside, std:: functions, OpenMP over the directions. A peer for benchmarks/evaluation.py, written from the
// equations of the paper and independent of pbrdf's code; dielectric coating, readings "weighted" and "flux".
//
// g++ -O3 -march=native -ffast-math -fopenmp -shared -fPIC double_gauss.cpp -o libdouble_gauss.so
//
// With -DBRANCHLESS a hidden facet is given weight 0 instead of being skipped. That is all g++ needs to run the
// loops over the facets on vectors, with the vector functions of the GNU C library; as most people write it,
// with the early return, they stay scalar.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double far_edge = 50.0;  // an edge of the wedge this many standard deviations out is out of reach

struct Vec3 {
    double x, y, z;
};

inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

inline Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct Paint {
    double sigma, n, a, k, b, t;
};

// When to use which rule for the facets, and the trapezoidal rule where edges cut in; see the NumPy program
struct Rule {
    double clear_7, clear_12, clear_26, far, rough, spread_7, slope_7, spread_12, slope_12, step;
    int64_t half, four, two;
};

struct Node {
    double x, y, weight;
};

// Stroud's E2(r^2) 5-1 and 7-1 and five Gauss-Hermite rows of 4, 6, 6, 6 and 4 points, for the normal density
struct Cubatures {
    // positive points of Gauss-Hermite rules of 2, 4 and 6 points, and their weights
    double points[3][3] = {{1.0}};
    double weights[3][3] = {{0.5}};
    Node seven[7], twelve[12], rows[26];

    Cubatures() {
        for (int n : {4, 6}) {
            for (int i = 0; i < n / 2; ++i) {  // Newton's method on the Hermite polynomial
                double x = n == 4 ? (i ? 2.33 : 0.74) : (i == 2 ? 3.32 : i ? 1.89 : 0.62), before = 0.0;
                for (int step = 0; step < 20; ++step) {
                    double last = 1.0, now = x;
                    for (int j = 1; j < n; ++j) {
                        const double next = x * now - j * last;
                        last = now, now = next;
                    }
                    x -= now / (n * last), before = last;
                }
                double factorial = 1.0;
                for (int j = 2; j < n; ++j) factorial *= j;
                points[n / 2 - 1][i] = x;
                weights[n / 2 - 1][i] = factorial / (n * before * before);
            }
        }
        const double r = std::sqrt(6.0), root3 = std::sqrt(3.0), root5 = std::sqrt(5.0), root10 = std::sqrt(10.0);
        int count = 0;
        seven[count++] = {0.0, 0.0, 0.5};
        for (double sign : {-1.0, 1.0}) {
            seven[count++] = {0.0, 2.0 * sign, 1.0 / 12.0};
            for (double other : {-1.0, 1.0}) seven[count++] = {sign * root3, other, 1.0 / 12.0};
        }
        const double s = std::sqrt((9.0 - 3.0 * root5) / 4.0), t = std::sqrt((9.0 + 3.0 * root5) / 4.0);
        const double w_s = (5.0 + 2.0 * root5) / 45.0, w_t = (5.0 - 2.0 * root5) / 45.0;
        count = 0;
        for (double sign : {-1.0, 1.0}) {
            twelve[count++] = {sign * r, 0.0, 1.0 / 36.0};
            twelve[count++] = {0.0, sign * r, 1.0 / 36.0};
            for (double other : {-1.0, 1.0}) {
                twelve[count++] = {sign * s, other * s, w_s};
                twelve[count++] = {sign * t, other * t, w_t};
            }
        }
        const double inner = std::sqrt(5.0 - root10), outer = std::sqrt(5.0 + root10);
        const double w_inner = (7.0 + 2.0 * root10) / 60.0, w_outer = (7.0 - 2.0 * root10) / 60.0;
        const double node[5] = {-outer, -inner, 0.0, inner, outer};
        const double weight[5] = {w_outer, w_inner, 8.0 / 15.0, w_inner, w_outer};
        count = 0;
        for (int i = 0; i < 5; ++i) {
            const int half = i % 4 ? 3 : 2;
            for (int j = 0; j < half; ++j)
                for (double sign : {-1.0, 1.0})
                    rows[count++] = {node[i], sign * points[half - 1][j], weight[i] * weights[half - 1][j]};
        }
    }
};

const Cubatures cubatures;

// Directions, and the (p, s) frames about the two rays
struct Geometry {
    double sin_i, cos_i, sin_r, cos_r, sin_phi, cos_phi;
    Vec3 omega_i, omega_r, p_i, s_i, p_r, s_r;

    Geometry(double theta_i, double theta_r, double phi)
        : sin_i(std::sin(theta_i)), cos_i(std::cos(theta_i)), sin_r(std::sin(theta_r)), cos_r(std::cos(theta_r)),
          sin_phi(std::sin(phi)), cos_phi(std::cos(phi)),
          omega_i{-sin_i, 0.0, cos_i}, omega_r{sin_r * cos_phi, sin_r * sin_phi, cos_r},
          p_i{cos_i, 0.0, sin_i}, s_i{0.0, -1.0, 0.0},
          p_r{-cos_r * cos_phi, -cos_r * sin_phi, sin_r}, s_r{sin_phi, -cos_phi, 0.0} {}
};

// Sums over the facets: W, W T+, W T- cos(2 chi), W T- sin(2 chi)
struct Sums {
    double shape = 0.0, intensity = 0.0, q = 0.0, u = 0.0;
};

// Add the facet of slopes (x, y) sigma to the sums
inline void add_facet(const Geometry& g, const Paint& paint, double x, double y, double weight, Sums& sums) {
    const double slope_x = paint.sigma * x, slope_y = paint.sigma * y;
    const double m_z = 1.0 / std::sqrt(1.0 + slope_x * slope_x + slope_y * slope_y);
    const Vec3 m{slope_x * m_z, slope_y * m_z, m_z};
    double mu_i = dot(m, g.omega_i), mu_r = dot(m, g.omega_r);
#ifdef BRANCHLESS
    const bool hidden = mu_i <= 0.0 || mu_r <= 0.0;
    weight = hidden ? 0.0 : weight, mu_i = hidden ? 1.0 : mu_i, mu_r = hidden ? 1.0 : mu_r;
#else
    if (mu_i <= 0.0 || mu_r <= 0.0) return;
#endif
    const double W = weight * std::exp((paint.k - 1.0) * std::log((mu_i + mu_r) * mu_i * mu_r));
    // Fresnel: T_s = 4 c q/(c + q)^2, and (T_p - T_s)/2 = half sin^2(beta) with q^2 = eps - sin^2(beta)
    const double eps = paint.n * paint.n;
    const double sin2 = 1.0 - mu_r * mu_r;
    const double q = std::sqrt(eps - sin2);
    const double inv_s = 1.0 / (mu_r + q), ratio = (eps - 1.0) / (eps * mu_r + q);
    const double T_s = 4.0 * mu_r * q * inv_s * inv_s;
    const double half = 0.5 * T_s * ratio * ratio;
    // sin^2(beta) cos(2 chi) and sin^2(beta) sin(2 chi), chi the turn from the surface's to the facet's frame
    const double along_p = dot(m, g.p_r), along_s = dot(m, g.s_r);
    sums.shape += W;
    sums.intensity += W * (T_s + half * sin2);
    sums.q += W * half * (along_p * along_p - along_s * along_s);
    sums.u += W * half * 2.0 * along_p * along_s;
}

// 1 - Phi(x)
inline double upper_tail(double x) { return 0.5 * std::erfc(x / std::sqrt(2.0)); }

// x > 0 with 1 - Phi(x) = p, by Newton's method on the logarithm, whose curve is nearly a parabola
inline double inverse_tail(double p) {
    const double goal = std::log(p);
    double x = std::sqrt(std::max(-2.0 * (goal - std::log(0.5)), 0.0));
    for (int step = 0; step < 6; ++step) {
        const double tail = upper_tail(x);
        x += (std::log(tail) - goal) * tail * std::sqrt(2.0 * pi) * std::exp(0.5 * x * x);
    }
    return x;
}

// Map z, of which Phi(z) and 1 - Phi(z) are given, to Phi^-1[Phi(low) + (Phi(high) - Phi(low)) Phi(z)]
inline double between(double below, double above, double low, double high, double& share) {
    const double beyond_low = upper_tail(-low), beyond_high = upper_tail(high);
    share = std::max(1.0 - beyond_low - beyond_high, 0.0);
    const double left = beyond_low + share * below, right = beyond_high + share * above;
    const double x = inverse_tail(std::clamp(std::min(left, right), 1e-18, 0.5));
    return left < right ? -x : x;
}

struct Trapezoid {
    std::vector<double> below, above, weight, place;

    Trapezoid(double step, int64_t count) {
        double total = 0.0;
        for (int64_t j = 0; j < count; ++j) {
            place.push_back(j - 0.5 * (count - 1));
            const double z = step * place.back();
            below.push_back(upper_tail(-z)), above.push_back(upper_tail(z)), weight.push_back(std::exp(-0.5 * z * z));
            total += weight.back();
        }
        for (double& w : weight) w /= total;
    }
};

// The rule and what follows from it
struct Tables {
    Rule rule;
    Trapezoid rows, columns;

    explicit Tables(const Rule& r) : rule(r), rows(r.step, 2 * r.half + 1), columns(r.step, 2 * r.half) {}
};

// Rows along the nearer edge, the only one
void sum_edge(const Geometry& g, const Paint& paint, const Tables& tables, double c_i, double c_r, Sums& sums) {
    const Rule& rule = tables.rule;
    const double f_x = c_i <= c_r ? 1.0 : -g.cos_phi, f_y = c_i <= c_r ? 0.0 : -g.sin_phi;
    for (int64_t row = 0; row <= 2 * rule.half; ++row) {
        const int64_t from_middle = std::abs(row - rule.half);
        if (from_middle > rule.two) continue;
        const int half = from_middle <= rule.four ? 2 : 1;
        double share;
        const double w = between(tables.rows.below[row], tables.rows.above[row], -far_edge, std::min(c_i, c_r), share);
        for (int j = 0; j < half; ++j)
            for (double sign : {-1.0, 1.0}) {
                const double v = sign * cubatures.points[half - 1][j];
                const double weight = tables.rows.weight[row] * share * cubatures.weights[half - 1][j];
                add_facet(g, paint, f_x * w - f_y * v, f_y * w + f_x * v, weight, sums);
            }
    }
}

// Rows in the wedge x < c_i, -(x cos(phi) + y sin(phi)) < c_r
void sum_wedge(const Geometry& g, const Paint& paint, const Tables& tables, double c_i, double c_r, Sums& sums) {
    const Rule& rule = tables.rule;
    double f_x, f_y, e_x, e_y;  // outer and inner axis
    double w_max, low_0, low_1, high_0, high_1;  // w < w_max, low_0 + low_1 w < v < high_0 + high_1 w
    if (g.cos_phi > 0.0) {  // the rays lie on opposite sides: outer axis into the corner, inner axis across
        const double cos_half = std::sqrt(0.5 * (1.0 + g.cos_phi)), sin_half = 0.5 * g.sin_phi / cos_half;
        const double sign = sin_half > 0.0 ? 1.0 : -1.0, C = std::max(std::abs(sin_half), 1e-12);
        e_x = cos_half, e_y = sin_half;
        f_x = sign * sin_half, f_y = -sign * cos_half;
        w_max = 0.5 * (c_i + c_r) / C;
        low_0 = -c_r / cos_half, low_1 = C / cos_half;
        high_0 = c_i / cos_half, high_1 = -low_1;
    } else {  // same side: outer axis across the nearer edge, the farther one bounds the inner axis from above
        const double inverse = 1.0 / std::max(std::abs(g.sin_phi), 1e-12);
        double sign;
        if (c_i <= c_r) {
            f_x = 1.0, f_y = 0.0;
            sign = g.sin_phi > 0.0 ? -1.0 : 1.0;
        } else {
            f_x = -g.cos_phi, f_y = -g.sin_phi;
            sign = g.sin_phi > 0.0 ? 1.0 : -1.0;
        }
        e_x = -sign * f_y, e_y = sign * f_x;
        w_max = std::min(c_i, c_r);
        low_0 = -far_edge, low_1 = 0.0;
        high_0 = std::max(c_i, c_r) * inverse, high_1 = g.cos_phi * inverse;
    }
    const double reach = (rule.half + 0.4) * (rule.half + 0.4);
    for (int64_t row = 0; row <= 2 * rule.half; ++row) {
        double share, inner_share;
        const double w = between(tables.rows.below[row], tables.rows.above[row], -far_edge, w_max, share);
        const double low = low_0 + low_1 * w, high = high_0 + high_1 * w, place = tables.rows.place[row];
        for (int64_t j = 0; j < 2 * rule.half; ++j) {
            if (place * place + tables.columns.place[j] * tables.columns.place[j] > reach) continue;
            const double v = between(tables.columns.below[j], tables.columns.above[j], low, high, inner_share);
            const double weight = tables.rows.weight[row] * tables.columns.weight[j] * share * inner_share;
            add_facet(g, paint, f_x * w + e_x * v, f_y * w + e_y * v, weight, sums);
        }
    }
}

// A cubature of the whole plane, turned to the viewer
template <int count>
void sum_clear(const Geometry& g, const Paint& paint, const Node (&nodes)[count], Sums& sums) {
    for (const Node& n : nodes)
        add_facet(g, paint, n.y * g.sin_phi - n.x * g.cos_phi, -n.x * g.sin_phi - n.y * g.cos_phi, n.weight, sums);
}

// Diffuse part, eqs (9)-(13): adds to the first column of f
void add_diffuse(const Geometry& g, const Paint& paint, const Tables& tables, double* f) {
    const double c_i = g.cos_i / std::max(paint.sigma * g.sin_i, g.cos_i / far_edge);
    const double c_r = g.cos_r / std::max(paint.sigma * g.sin_r, g.cos_r / far_edge);
    Sums sums;
    const Rule& rule = tables.rule;
    const double nearer = std::min(c_i, c_r), root = std::sqrt(paint.sigma);
    const double steep = std::abs(paint.k - 1.0) * paint.sigma * root;
    if (paint.sigma > rule.rough)
        sum_wedge(g, paint, tables, c_i, c_r, sums);
    else if (nearer > std::max({rule.clear_7, rule.spread_7 * root, steep / rule.slope_7}))
        sum_clear(g, paint, cubatures.seven, sums);
    else if (nearer > std::max({rule.clear_12, rule.spread_12 * root, steep / rule.slope_12}))
        sum_clear(g, paint, cubatures.twelve, sums);
    else if (nearer > rule.clear_26)
        sum_clear(g, paint, cubatures.rows, sums);
    else if (std::max(c_i, c_r) > rule.far)
        sum_edge(g, paint, tables, c_i, c_r, sums);
    else
        sum_wedge(g, paint, tables, c_i, c_r, sums);
    const double cos_scattering = g.sin_i * g.sin_r * g.cos_phi - g.cos_i * g.cos_r;
    const double f_rpv = paint.a / pi *
                         std::exp((paint.k - 1.0) * std::log((g.cos_i + g.cos_r) * g.cos_i * g.cos_r) +
                                  paint.b * cos_scattering);
    const double polarised = f_rpv * paint.t / sums.shape;
    f[0] += f_rpv * (1.0 - paint.t) + polarised * sums.intensity;
    f[4] += polarised * sums.q;
    f[8] += polarised * sums.u;
}

// cos(2 chi) and sin(2 chi) of the turn from the frame (p, s) to the frame with the s direction along `s_facet`
inline void turn(const Vec3& s_facet, const Vec3& p, const Vec3& s, double& cos_2chi, double& sin_2chi) {
    const double c = dot(s_facet, s), d = -dot(s_facet, p);
    const double scale = 1.0 / (c * c + d * d);
    cos_2chi = (c * c - d * d) * scale;
    sin_2chi = 2.0 * c * d * scale;
}

// Specular part, eqs (2)-(8): writes all of f
void set_specular(const Geometry& g, const Paint& paint, double* f) {
    const Vec3 h{g.omega_i.x + g.omega_r.x, g.omega_i.y + g.omega_r.y, g.omega_i.z + g.omega_r.z};
    const double scale_h = 1.0 / std::sqrt(dot(h, h));
    const double cos_theta = h.z * scale_h;
    const double cos_beta = dot(g.omega_i, h) * scale_h;
    const double tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
    const double variance = paint.sigma * paint.sigma;
    const double P =
        std::exp(-0.5 * tan2 / variance) / (2.0 * pi * variance * cos_theta * cos_theta * cos_theta);
    const double G = std::min(1.0, 2.0 * cos_theta * std::min(g.cos_i, g.cos_r) / cos_beta);
    const double scale = P * G / (4.0 * cos_theta * g.cos_i * g.cos_r);

    const double eps = paint.n * paint.n;
    const double q = std::sqrt(eps - (1.0 - cos_beta * cos_beta));
    const double r_s = (cos_beta - q) / (cos_beta + q), r_p = (eps * cos_beta - q) / (eps * cos_beta + q);
    const double A = 0.5 * (r_p * r_p + r_s * r_s) * scale;
    const double B = 0.5 * (r_p * r_p - r_s * r_s) * scale;
    const double C = r_p * r_s * scale;

    Vec3 s_facet = cross(g.omega_r, g.omega_i);
    if (dot(s_facet, s_facet) < 1e-30) s_facet = g.s_i;  // exact backscatter: any direction across the ray will do
    double c1, s1, c2, s2;
    turn(s_facet, g.p_i, g.s_i, c1, s1);
    turn(s_facet, g.p_r, g.s_r, c2, s2);

    f[0] = A, f[1] = B * c1, f[2] = B * s1, f[3] = 0.0;
    f[4] = B * c2, f[5] = A * c1 * c2 + C * s1 * s2, f[6] = A * s1 * c2 - C * c1 * s2, f[7] = 0.0;
    f[8] = B * s2, f[9] = A * c1 * s2 - C * s1 * c2, f[10] = A * s1 * s2 + C * c1 * c2, f[11] = 0.0;
    f[12] = 0.0, f[13] = 0.0, f[14] = 0.0, f[15] = C;
}

}  // namespace

// Mueller matrices (1/sr), 16 numbers a direction; paint: sigma, n, a, k, b, t
extern "C" void double_gauss_mueller(int64_t count, const double* theta_i, const double* theta_r,
                                     const double* phi, const Paint* paint, const Rule* rule, int threads,
                                     double* mueller) {
    const Tables tables(*rule);
#pragma omp parallel for schedule(dynamic, 1024) num_threads(threads)
    for (int64_t j = 0; j < count; ++j) {
        const Geometry g(theta_i[j], theta_r[j], phi[j]);
        set_specular(g, *paint, mueller + 16 * j);
        add_diffuse(g, *paint, tables, mueller + 16 * j);
    }
}
