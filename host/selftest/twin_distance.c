#include "selftest/twin_distance.h"

#include <math.h>

static void subtract(const double *a, const double *b, double *result) {
    for (int k = 0; k < 3; ++k)
        result[k] = a[k] - b[k];
}

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *result) {
    result[0] = a[1] * b[2] - a[2] * b[1];
    result[1] = a[2] * b[0] - a[0] * b[2];
    result[2] = a[0] * b[1] - a[1] * b[0];
}

static double segment_distance(const double *point, const double *a, const double *b) {
    double edge[3], to[3];
    subtract(b, a, edge);
    subtract(point, a, to);
    const double square = dot(edge, edge);
    const double t = square > 0.0 ? fmin(fmax(dot(to, edge) / square, 0.0), 1.0) : 0.0;
    for (int k = 0; k < 3; ++k)
        to[k] -= t * edge[k];
    return sqrt(dot(to, to));
}

/* Whether the projection of the point lies on the inner side of edge ab. */
static bool inside(const double *point, const double *a, const double *b, const double *normal) {
    double edge[3], to[3], side[3];
    subtract(b, a, edge);
    subtract(point, a, to);
    cross(normal, edge, side);
    return dot(side, to) >= 0.0;
}

double ov_twin_triangle_distance(const double point[3], const double a[3], const double b[3],
                                 const double c[3]) {
    double u[3], v[3], normal[3], to[3];
    subtract(b, a, u);
    subtract(c, a, v);
    subtract(point, a, to);
    cross(u, v, normal);
    const double length = sqrt(dot(normal, normal));
    if (length > 0.0 && inside(point, a, b, normal) && inside(point, b, c, normal) &&
        inside(point, c, a, normal))
        return fabs(dot(to, normal)) / length;
    return fmin(segment_distance(point, a, b),
                fmin(segment_distance(point, b, c), segment_distance(point, c, a)));
}

static bool left_out(const ovoid_mesh *mesh, const uint32_t *corner, bool outer_only) {
    const uint32_t component = ovoid_mesh_component_of(mesh)[corner[0]];
    return outer_only && !ovoid_mesh_component(mesh, component)->outer;
}

double ov_twin_mesh_distance(const double point[3], const ovoid_mesh *mesh, bool outer_only) {
    const double *const xyz = ovoid_mesh_xyz(mesh);
    double least = INFINITY;
    for (size_t t = 0; t < ovoid_mesh_triangles(mesh); ++t) {
        const uint32_t *const corner = ovoid_mesh_corners(mesh) + 3 * t;
        if (!left_out(mesh, corner, outer_only))
            least = fmin(least, ov_twin_triangle_distance(point, xyz + 3 * (size_t)corner[0],
                                                          xyz + 3 * (size_t)corner[1],
                                                          xyz + 3 * (size_t)corner[2]));
    }
    return least;
}

typedef struct sums {
    double largest, mean, square, area;
} sums;

/* Per triangle: 3/4 of its area at the centre, 1/12 at each corner. */
static sums one_way(const ovoid_mesh *from, const ovoid_mesh *to, bool outer_only) {
    const double *const xyz = ovoid_mesh_xyz(from);
    sums s = {0};
    for (size_t t = 0; t < ovoid_mesh_triangles(from); ++t) {
        const uint32_t *const corner = ovoid_mesh_corners(from) + 3 * t;
        double u[3], v[3], normal[3], centre[3];
        if (left_out(from, corner, outer_only))
            continue;
        subtract(xyz + 3 * (size_t)corner[1], xyz + 3 * (size_t)corner[0], u);
        subtract(xyz + 3 * (size_t)corner[2], xyz + 3 * (size_t)corner[0], v);
        cross(u, v, normal);
        const double area = 0.5 * sqrt(dot(normal, normal));
        for (int k = 0; k < 3; ++k)
            centre[k] = xyz[3 * (size_t)corner[0] + (size_t)k] + (u[k] + v[k]) / 3.0;
        for (int i = 0; i < 4; ++i) {
            const double d =
                ov_twin_mesh_distance(i < 3 ? xyz + 3 * (size_t)corner[i] : centre, to, outer_only);
            const double weight = area * (i < 3 ? 1.0 / 12.0 : 0.75);
            s.largest = fmax(s.largest, d);
            s.mean += weight * d;
            s.square += weight * d * d;
        }
        s.area += area;
    }
    return s;
}

ovoid_distances ov_twin_distances(const ovoid_mesh *a, const ovoid_mesh *b, bool outer_only) {
    const sums forward = one_way(a, b, outer_only), backward = one_way(b, a, outer_only);
    return (ovoid_distances){
        .hausdorff = fmax(forward.largest, backward.largest),
        .forward = forward.largest,
        .backward = backward.largest,
        .mean = 0.5 * (forward.mean / forward.area + backward.mean / backward.area),
        .rms = sqrt(0.5 * (forward.square / forward.area + backward.square / backward.area))};
}
