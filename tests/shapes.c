#include "shapes.h"

#include "support.h"

#define PI 3.14159265358979323846

void shape_destroy(shape *s) {
    free(s->xyz);
    free(s->normals);
    free(s->corners);
    memset(s, 0, sizeof *s);
}

static void *grown(void *array, size_t bytes) {
    void *const memory = realloc(array, bytes);
    if (!memory)
        abort();
    return memory;
}

static uint32_t add_vertex(shape *s, const double *xyz, const double *normal) {
    if ((s->vertices & (s->vertices - 1)) == 0) {
        const size_t room = s->vertices ? 2 * s->vertices : 1;
        s->xyz = grown(s->xyz, room * 3 * sizeof *s->xyz);
        s->normals = grown(s->normals, room * 3 * sizeof *s->normals);
    }
    for (size_t k = 0; k < 3; ++k) {
        s->xyz[3 * s->vertices + k] = xyz[k];
        s->normals[3 * s->vertices + k] = (float)normal[k];
    }
    return (uint32_t)s->vertices++;
}

static void add_triangle(shape *s, uint32_t a, uint32_t b, uint32_t c) {
    if ((s->triangles & (s->triangles - 1)) == 0) {
        const size_t room = s->triangles ? 2 * s->triangles : 1;
        s->corners = grown(s->corners, room * 3 * sizeof *s->corners);
    }
    uint32_t *const corner = s->corners + 3 * s->triangles++;
    corner[0] = a;
    corner[1] = b;
    corner[2] = c;
}

/* The middles of edges that were met, by a hash of their ends. */
typedef struct middles {
    uint64_t *key;
    uint32_t *vertex;
    size_t mask;
} middles;

static void normalise(double *x) {
    const double length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    for (size_t k = 0; k < 3; ++k)
        x[k] /= length;
}

static uint32_t middle(shape *s, middles *m, uint32_t a, uint32_t b) {
    const uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
    size_t slot = (size_t)((key * 0x9e3779b97f4a7c15u) >> 20) & m->mask;
    while (m->key[slot] && m->key[slot] != key)
        slot = (slot + 1) & m->mask;
    if (!m->key[slot]) {
        double x[3];
        for (size_t k = 0; k < 3; ++k)
            x[k] = s->xyz[3 * (size_t)a + k] + s->xyz[3 * (size_t)b + k];
        normalise(x);
        m->key[slot] = key;
        m->vertex[slot] = add_vertex(s, x, x);
    }
    return m->vertex[slot];
}

static void split_triangles(shape *s) {
    middles m = {.mask = 64};
    while (m.mask < 4 * s->triangles)
        m.mask *= 2;
    m.key = test_alloc(m.mask, sizeof *m.key);
    m.vertex = test_alloc(m.mask, sizeof *m.vertex);
    m.mask -= 1;
    const size_t before = s->triangles;
    for (size_t t = 0; t < before; ++t) {
        const uint32_t a = s->corners[3 * t], b = s->corners[3 * t + 1], c = s->corners[3 * t + 2];
        const uint32_t ab = middle(s, &m, a, b), bc = middle(s, &m, b, c), ca = middle(s, &m, c, a);
        add_triangle(s, a, ab, ca);
        add_triangle(s, ab, b, bc);
        add_triangle(s, ca, bc, c);
        s->corners[3 * t] = ab;
        s->corners[3 * t + 1] = bc;
        s->corners[3 * t + 2] = ca;
    }
    free(m.key);
    free(m.vertex);
}

static void make_icosphere(shape *s, int levels) {
    static const uint32_t faces[20][3] = {
        {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
        {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
        {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    const double g = 0.5 * (1.0 + sqrt(5.0));
    const double points[12][3] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                                  {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                                  {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
    for (size_t i = 0; i < 12; ++i) {
        double x[3] = {points[i][0], points[i][1], points[i][2]};
        normalise(x);
        add_vertex(s, x, x);
    }
    for (size_t i = 0; i < 20; ++i)
        add_triangle(s, faces[i][0], faces[i][1], faces[i][2]);
    for (int level = 0; level < levels; ++level)
        split_triangles(s);
}

void shape_add_ellipsoid(shape *s, int levels, const double axes[3], const double centre[3],
                         bool inward) {
    shape unit = {0};
    make_icosphere(&unit, levels);
    const uint32_t first = (uint32_t)s->vertices;
    for (size_t v = 0; v < unit.vertices; ++v) {
        double x[3], normal[3];
        for (size_t k = 0; k < 3; ++k) {
            x[k] = centre[k] + axes[k] * unit.xyz[3 * v + k];
            normal[k] = (inward ? -1.0 : 1.0) * unit.xyz[3 * v + k] / axes[k];
        }
        normalise(normal);
        add_vertex(s, x, normal);
    }
    for (size_t t = 0; t < unit.triangles; ++t) {
        const uint32_t *const corner = unit.corners + 3 * t;
        add_triangle(s, first + corner[0], first + corner[inward ? 2 : 1],
                     first + corner[inward ? 1 : 2]);
    }
    shape_destroy(&unit);
}

void shape_add_sphere(shape *s, int levels, double radius, double x, double y, double z) {
    shape_add_ellipsoid(s, levels, (const double[3]){radius, radius, radius},
                        (const double[3]){x, y, z}, false);
}

void shape_add_torus(shape *s, size_t n, double major, double minor) {
    const uint32_t first = (uint32_t)s->vertices;
    for (size_t i = 0; i < 2 * n; ++i)
        for (size_t j = 0; j < n; ++j) {
            const double a = PI * (double)i / (double)n, b = 2.0 * PI * (double)j / (double)n;
            const double normal[3] = {cos(a) * cos(b), sin(a) * cos(b), sin(b)};
            const double x[3] = {major * cos(a) + minor * normal[0],
                                 major * sin(a) + minor * normal[1], minor * normal[2]};
            add_vertex(s, x, normal);
        }
    for (size_t i = 0; i < 2 * n; ++i)
        for (size_t j = 0; j < n; ++j) {
            const size_t k = (i + 1) % (2 * n), l = (j + 1) % n;
            const uint32_t a = first + (uint32_t)(i * n + j), b = first + (uint32_t)(k * n + j),
                           c = first + (uint32_t)(k * n + l), d = first + (uint32_t)(i * n + l);
            add_triangle(s, a, b, c);
            add_triangle(s, a, c, d);
        }
}

void shape_add_square(shape *s, size_t n, double half, double z) {
    const uint32_t first = (uint32_t)s->vertices, row = (uint32_t)n + 1;
    for (size_t i = 0; i <= n; ++i)
        for (size_t j = 0; j <= n; ++j) {
            const double x[3] = {half * (2.0 * (double)i / (double)n - 1.0),
                                 half * (2.0 * (double)j / (double)n - 1.0), z};
            add_vertex(s, x, (const double[3]){0.0, 0.0, 1.0});
        }
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < n; ++j) {
            const uint32_t a = first + i * row + j;
            add_triangle(s, a, a + row, a + row + 1);
            add_triangle(s, a, a + row + 1, a + 1);
        }
}

ovoid_mesh *shape_mesh(ovoid_context *context, const shape *s) {
    ovoid_mesh *mesh = NULL;
    test_check(context, ovoid_mesh_create(context, s->xyz, s->normals, s->vertices, s->corners,
                                          s->triangles, &mesh));
    return mesh;
}

/* Over the unit sphere, of |cofactor n|; midpoints in both angles, spectrally accurate in one. */
double ellipsoid_area(const double axes[3]) {
    enum { POLAR = 4000, AROUND = 400 };
    double sum = 0.0;
    for (int i = 0; i < POLAR; ++i) {
        const double cosine = -1.0 + (2.0 * i + 1.0) / POLAR;
        const double sine = sqrt(1.0 - cosine * cosine);
        for (int j = 0; j < AROUND; ++j) {
            const double a = 2.0 * PI * j / AROUND;
            const double x = sine * cos(a) * axes[1] * axes[2];
            const double y = sine * sin(a) * axes[0] * axes[2];
            const double z = cosine * axes[0] * axes[1];
            sum += sqrt(x * x + y * y + z * z);
        }
    }
    return sum * 4.0 * PI / ((double)POLAR * AROUND);
}
