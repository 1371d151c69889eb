/*
 * Marching cubes: the table of cases for all of them and all pairs of neighbours; meshes against a
 * plain one in double, closed forms and topology; the seams between pieces.
 */
#include "support.h"

#include <unistd.h>

#include "mesh/case_table.h"
#include "mesh/march.h"
#include "mesh/mesh.h"
#include "model/ellipsoid.h"
#include "model/model.h"
#include "selftest/twin_march.h"

#define PI 3.14159265358979323846
#define APBS_FAS2 "/usr/share/apbs/examples/misc/fas2.pqr"

static const uint64_t whole[3] = OV_MARCH_PIECE;

/* ---- the table of cases ------------------------------------------------------------------- */

static void edge_ends(unsigned edge, unsigned end[2]) {
    end[0] = edge % 8;
    end[1] = end[0] | 1u << edge / 8;
}

static bool is_inside(unsigned index, unsigned corner) {
    return index >> corner & 1u;
}

static bool is_crossed(unsigned index, unsigned edge) {
    unsigned end[2];
    edge_ends(edge, end);
    return end[0] != end[1] && (edge % 8 & 1u << edge / 8) == 0 &&
           is_inside(index, end[0]) != is_inside(index, end[1]);
}

static void middle_of(unsigned edge, double at[3]) {
    unsigned end[2];
    edge_ends(edge, end);
    for (unsigned axis = 0; axis < 3; ++axis)
        at[axis] = 0.5 * ((end[0] >> axis & 1u) + (end[1] >> axis & 1u));
}

/* The face that two edges share, as 2 * axis + side, or 6. */
static unsigned common_face(unsigned a, unsigned b) {
    double p[3], q[3];
    middle_of(a, p);
    middle_of(b, q);
    for (unsigned axis = 0; axis < 3; ++axis)
        if (p[axis] == q[axis] && p[axis] != 0.5)
            return 2 * axis + (p[axis] > 0.5);
    return 6;
}

static double triple(const double a[3], const double b[3], const double c[3]) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* The inside lies to the right of a segment seen from outside the cell: so do triangles whose sides
 * they are face outward. */
static void expect_outward(unsigned index, unsigned from, unsigned to) {
    const unsigned face = common_face(from, to);
    double start[3], end[3], normal[3] = {0}, along[3], inward[3];
    unsigned ends[2];
    assert_true(face < 6);
    middle_of(from, start);
    middle_of(to, end);
    edge_ends(from, ends);
    normal[face / 2] = face % 2 ? 1.0 : -1.0;
    const unsigned inside = is_inside(index, ends[0]) ? ends[0] : ends[1];
    for (unsigned axis = 0; axis < 3; ++axis) {
        along[axis] = end[axis] - start[axis];
        inward[axis] = (inside >> axis & 1u) - start[axis];
    }
    assert_true(triple(normal, along, inward) < 0.0);
}

static void loops_are_closed_and_face_outward(void **state) {
    (void)state;
    for (unsigned index = 0; index < OV_CASES; ++index) {
        uint8_t next[OV_CELL_EDGES];
        unsigned arrivals[OV_CELL_EDGES] = {0};
        ov_case_segments(index, next);
        for (unsigned edge = 0; edge < OV_CELL_EDGES; ++edge) {
            assert_true((next[edge] != OV_CELL_EDGES) == is_crossed(index, edge));
            if (next[edge] == OV_CELL_EDGES)
                continue;
            ++arrivals[next[edge]];
            expect_outward(index, edge, next[edge]);
        }
        for (unsigned edge = 0; edge < OV_CELL_EDGES; ++edge)
            assert_int_equal(arrivals[edge], is_crossed(index, edge));
    }
}

/* Every segment is one side of one triangle; every other side is a cut through the cell, there once
 * in each direction and in no face. */
static void triangles_fill_the_loops(void **state) {
    (void)state;
    ov_case_table table;
    ov_case_table_make(&table);
    for (unsigned index = 0; index < OV_CASES; ++index) {
        unsigned sides[OV_CELL_EDGES][OV_CELL_EDGES] = {{0}};
        uint8_t next[OV_CELL_EDGES];
        const uint8_t *const entry = table.entry[index];
        ov_case_segments(index, next);
        assert_true(entry[0] <= OV_CASE_TRIANGLES);
        for (unsigned t = 0; t < entry[0]; ++t)
            for (unsigned k = 0; k < 3; ++k)
                ++sides[entry[1 + 3 * t + k]][entry[1 + 3 * t + (k + 1) % 3]];
        for (unsigned a = 0; a < OV_CELL_EDGES; ++a)
            for (unsigned b = 0; b < OV_CELL_EDGES; ++b) {
                const bool segment = next[a] == b, reverse = next[b] == a;
                if (segment || reverse) {
                    assert_int_equal(sides[a][b], segment);
                } else if (sides[a][b] > 0) {
                    assert_int_equal(sides[a][b], 1);
                    assert_int_equal(sides[b][a], 1);
                    assert_int_equal(common_face(a, b), 6);
                }
            }
    }
}

/* Segments of a case on one face, as pairs of edges with the face's axis left out. */
static void segments_on(unsigned index, unsigned axis, unsigned side,
                        bool segment[OV_CELL_EDGES][OV_CELL_EDGES]) {
    uint8_t next[OV_CELL_EDGES];
    const unsigned flip = side << axis;
    memset(segment, 0, sizeof(bool[OV_CELL_EDGES][OV_CELL_EDGES]));
    ov_case_segments(index, next);
    for (unsigned edge = 0; edge < OV_CELL_EDGES; ++edge)
        if (next[edge] != OV_CELL_EDGES && common_face(edge, next[edge]) == 2 * axis + side)
            segment[edge & ~flip][next[edge] & ~flip] = true;
}

static bool same_face(unsigned below, unsigned above, unsigned axis) {
    for (unsigned corner = 0; corner < 8; ++corner)
        if (!(corner >> axis & 1u) &&
            is_inside(below, corner | 1u << axis) != is_inside(above, corner))
            return false;
    return true;
}

static void neighbours_agree_on_their_face(void **state) {
    (void)state;
    static bool below[OV_CASES][OV_CELL_EDGES][OV_CELL_EDGES],
        above[OV_CASES][OV_CELL_EDGES][OV_CELL_EDGES];
    unsigned pairs = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
        for (unsigned index = 0; index < OV_CASES; ++index) {
            segments_on(index, axis, 1, below[index]);
            segments_on(index, axis, 0, above[index]);
        }
        for (unsigned a = 0; a < OV_CASES; ++a)
            for (unsigned b = 0; b < OV_CASES; ++b) {
                if (!same_face(a, b, axis))
                    continue;
                ++pairs;
                for (unsigned from = 0; from < OV_CELL_EDGES; ++from)
                    for (unsigned to = 0; to < OV_CELL_EDGES; ++to)
                        assert_int_equal(below[a][from][to], above[b][to][from]);
            }
    }
    assert_int_equal(pairs, 3 * 16 * 16 * 16);
}

/* ---- meshes ------------------------------------------------------------------------------- */

static int compare_keys(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Every edge has two triangles, which run along it in opposite directions; every vertex is used.
 * Returns vertices - edges + triangles. */
static int64_t expect_closed(const ovoid_mesh *mesh) {
    const size_t sides = 3 * ovoid_mesh_triangles(mesh), vertices = ovoid_mesh_vertices(mesh);
    const uint32_t *const corner = ovoid_mesh_corners(mesh);
    uint64_t *const forward = test_alloc(sides, sizeof *forward), *const backward = test_alloc(
                                                                      sides, sizeof *backward);
    bool *const used = test_alloc(vertices, sizeof *used);
    for (size_t k = 0; k < sides; ++k) {
        const uint64_t a = corner[k], b = corner[k % 3 == 2 ? k - 2 : k + 1];
        assert_true(a < vertices && b < vertices && a != b);
        forward[k] = a << 32 | b;
        backward[k] = b << 32 | a;
        used[a] = true;
    }
    qsort(forward, sides, sizeof *forward, compare_keys);
    qsort(backward, sides, sizeof *backward, compare_keys);
    for (size_t k = 0; k < sides; ++k) {
        assert_true(k == 0 || forward[k] != forward[k - 1]);
        assert_true(forward[k] == backward[k]);
    }
    for (size_t v = 0; v < vertices; ++v)
        assert_true(used[v]);
    free(forward);
    free(backward);
    free(used);
    return (int64_t)vertices - (int64_t)sides / 2 + (int64_t)sides / 3;
}

/* Vertices lie on edges of the lattice of multiples of the spacing, halved for specks. Returns the
 * axis of vertex v's edge and its low end; a vertex at a lattice point is taken for one on an edge
 * along x. */
static unsigned edge_of(const ovoid_mesh *mesh, size_t v, double spacing, int64_t low[3]) {
    const double *const at = ovoid_mesh_xyz(mesh) + 3 * v;
    unsigned axis = 0;
    double furthest = -1.0;
    spacing = mesh->edge ? ldexp(spacing, -(int)(mesh->edge[v] >> OV_EDGE_AXIS_BITS)) : spacing;
    for (unsigned k = 0; k < 3; ++k) {
        const double u = at[k] / spacing, off = fabs(u - round(u));
        low[k] = (int64_t)round(u);
        if (off > furthest) {
            furthest = off;
            axis = k;
        }
    }
    for (unsigned k = 0; k < 3; ++k)
        if (k != axis)
            expect_near(at[k] / spacing, (double)low[k], 1e-9 * (1.0 + fabs((double)low[k])),
                        "a vertex's lattice index");
    low[axis] = (int64_t)floor(at[axis] / spacing);
    return axis;
}

/* Closed, on the lattice, on the surface to within 1e-5 angstrom and beyond that only as far as phi
 * itself is rounded, normals along the gradient. Returns vertices - edges + triangles. */
static int64_t expect_surface(const ovoid_mesh *mesh, const ov_quadric *quadrics, size_t count,
                              const ovoid_mesh_options *options) {
    const double c = options->isovalue;
    double worst_distance = 0.0, worst_angle = 0.0;
    for (size_t v = 0; v < ovoid_mesh_vertices(mesh); ++v) {
        const double *const y = ovoid_mesh_xyz(mesh) + 3 * v;
        const float *const n = ovoid_mesh_normals(mesh) + 3 * v;
        ov_twin_sum gradient[3];
        int64_t low[3];
        const ov_twin_sum phi = ov_twin_field(quadrics, count, y);
        ov_twin_gradient(quadrics, count, y, gradient);
        const unsigned axis = edge_of(mesh, v, options->spacing, low);
        const double length =
            sqrt(gradient[0].value * gradient[0].value + gradient[1].value * gradient[1].value +
                 gradient[2].value * gradient[2].value);
        const double rounding = 3.0 * FLT_EPSILON * phi.scale + 1e-6 * c;
        const double miss = fabs(phi.value - c);
        if (options->vertices == OVOID_VERTEX_EXACT) {
            const double slope = fabs(gradient[axis].value);
            assert_true(miss <= 1e-5 * length + rounding);
            if (slope > 0.1 * c)
                worst_distance = fmax(worst_distance, miss / length);
        }
        double cosine = 0.0, square = 0.0;
        for (int k = 0; k < 3; ++k) {
            cosine -= n[k] * gradient[k].value / length;
            square += (double)n[k] * n[k];
        }
        expect_near(square, 1.0, 1e-5, "a normal's square");
        if (length > 0.1 * c)
            worst_angle = fmax(worst_angle, 1.0 - cosine);
    }
    print_message("%zu vertices, at most %.2g from the surface, 1 - cos of normals %.2g\n",
                  ovoid_mesh_vertices(mesh), worst_distance, worst_angle);
    assert_true(worst_angle < 1e-6);
    return expect_closed(mesh);
}

static ov_quadric *quadrics_of(const double *xyzr, size_t atoms, double decay) {
    ov_quadric *const quadrics = test_alloc(atoms, sizeof *quadrics);
    for (size_t i = 0; i < atoms; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, decay, &quadrics[i]);
    return quadrics;
}

static ovoid_mesh *mesh_atoms(ovoid_context *context, const double *xyzr, size_t atoms,
                              double decay, const ovoid_mesh_options *options) {
    ovoid_molecule *molecule = NULL;
    ovoid_mesh *mesh = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    test_check(context, once_molecule_mesh(context, molecule, decay, options, &mesh));
    ovoid_molecule_destroy(&molecule);
    return mesh;
}

/* Meshes atoms, holds the mesh to the twin and to this characteristic and number of components. */
static ovoid_mesh *expect_atoms(ovoid_context *context, const double *xyzr, size_t atoms,
                                double decay, const ovoid_mesh_options *options, int64_t euler,
                                size_t components) {
    ov_quadric *const quadrics = quadrics_of(xyzr, atoms, decay);
    ovoid_mesh *const mesh = mesh_atoms(context, xyzr, atoms, decay, options);
    assert_int_equal(expect_surface(mesh, quadrics, atoms, options), euler);
    assert_int_equal(ovoid_mesh_components(mesh), components);
    free(quadrics);
    return mesh;
}

static ovoid_mesh_options options_of(double isovalue, double spacing, ovoid_vertex_rule rule) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    assert_true(options.isovalue == 0.0 && options.spacing == OVOID_DEFAULT_MESH_SPACING);
    assert_true(options.vertices == OVOID_VERTEX_EXACT);
    options.isovalue = isovalue;
    options.spacing = spacing;
    options.vertices = rule;
    return options;
}

/* Twice as coarse for devices that are simulated. */
static double coarse(double spacing) {
    return test_small() ? 2.0 * spacing : spacing;
}

/* ---- closed forms ------------------------------------------------------------------------- */

/* One atom: a sphere of radius sqrt(r^2 - ln c / d). */
static void one_atom_is_a_sphere(void **state) {
    static const struct {
        double x, y, z, r, decay, c, spacing;
    } cases[] = {
        {0.1, -0.2, 0.3, 1.7, 0.5, 1.0, 0.5},   {0.0, 0.0, 0.0, 2.0, 0.5, 1.0, 0.5},
        {0.25, 0.25, 0.25, 1.5, 0.5, 1.0, 0.5}, {-7.3, 4.1, 90.2, 1.2, 0.9, 1.0, 0.3},
        {1.0, 2.0, 3.0, 0.0, 0.5, 0.5, 0.25},   {12345.67, -8901.2, 345.6, 1.5, 0.5, 1.3, 0.4},
        {0.3, 0.2, 0.1, 1.0, 0.5, 1e-20, 0.7},  {0.3, 0.2, 0.1, 6.0, 0.5, 1e6, 0.4},
        {0.0, 0.0, 0.0, 0.4, 3.0, 1.0, 0.7},
    };
    for (size_t k = 0; k < test_size(sizeof cases / sizeof cases[0], 2); ++k) {
        const double xyzr[4] = {cases[k].x, cases[k].y, cases[k].z, cases[k].r};
        const ovoid_mesh_options options =
            options_of(cases[k].c, cases[k].spacing, OVOID_VERTEX_EXACT);
        const double radius = sqrt(cases[k].r * cases[k].r - log(cases[k].c) / cases[k].decay);
        ovoid_mesh *mesh = expect_atoms(*state, xyzr, 1, cases[k].decay, &options, 2, 1);
        for (size_t v = 0; v < ovoid_mesh_vertices(mesh); ++v) {
            const double *const y = ovoid_mesh_xyz(mesh) + 3 * v;
            const double distance =
                sqrt((y[0] - xyzr[0]) * (y[0] - xyzr[0]) + (y[1] - xyzr[1]) * (y[1] - xyzr[1]) +
                     (y[2] - xyzr[2]) * (y[2] - xyzr[2]));
            expect_near(distance, radius, 1e-5, "a vertex's distance from the centre");
        }
        const double steps = radius / cases[k].spacing, volume = 4.0 / 3.0 * PI * pow(radius, 3);
        const double got = ovoid_mesh_volume(mesh) / volume;
        assert_true(got > 0.0 && got < 1.0 && (steps < 2.0 || got > 1.0 - 1.5 / (steps * steps)));
        ovoid_mesh_destroy(&mesh);
    }
}

/* At spacing 0.3, areas and volumes to 0.1 %. */
static void spheres_and_ellipsoids_have_their_measures(void **state) {
    if (test_small())
        skip();
    const ovoid_mesh_options options = options_of(1.0, 0.3, OVOID_VERTEX_EXACT);
    const double atom[4] = {0.11, 0.07, -0.31, 1.8}, radius = 1.8;
    ovoid_mesh *mesh = mesh_atoms(*state, atom, 1, 0.5, &options);
    expect_near(ovoid_mesh_smooth_area(mesh) / (4.0 * PI * radius * radius), 1.0, 1e-3, "area");
    expect_near(ovoid_mesh_smooth_volume(mesh) / (4.0 / 3.0 * PI * pow(radius, 3)), 1.0, 1e-3,
                "volume");
    ovoid_mesh_destroy(&mesh);

    const ovoid_ellipsoid ellipsoid = {
        .amplitude = 5.0, .decay = {0.6, 0.2, 0.08}, .angle = {0.7, -1.1, 2.0}};
    ovoid_model *model = NULL;
    ov_quadric quadric;
    double volume = 4.0 / 3.0 * PI;
    for (int k = 0; k < 3; ++k)
        volume *= sqrt(log(5.0) / ellipsoid.decay[k]);
    ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
    test_check(*state, ovoid_model_create(*state, &ellipsoid, 1, 0.5, 1.0, &model));
    test_check(*state, once_model_mesh(*state, model, &options, &mesh));
    assert_int_equal(expect_surface(mesh, &quadric, 1, &options), 2);
    expect_near(ovoid_mesh_smooth_volume(mesh) / volume, 1.0, 1e-3, "volume");
    ovoid_mesh_destroy(&mesh);
    ovoid_model_destroy(&model);
}

/* ---- shapes ------------------------------------------------------------------------------- */

static void two_spheres(void **state) {
    const ovoid_mesh_options options =
        options_of(1.0, test_small() ? 1.0 : 0.4, OVOID_VERTEX_EXACT);
    const double touching[8] = {0.0, 0.0, 0.0, 1.5, 2.2, 1.1, 0.9, 1.5},
                 apart[8] = {0.0, 0.0, 0.0, 1.5, 5.2, 3.1, 2.9, 1.2};
    ovoid_mesh *mesh = expect_atoms(*state, touching, 2, 0.5, &options, 2, 1);
    assert_true(ovoid_mesh_volume(mesh) > 4.0 / 3.0 * PI * pow(1.5, 3));
    ovoid_mesh_destroy(&mesh);
    mesh = expect_atoms(*state, apart, 2, 0.5, &options, 4, 2);
    for (size_t k = 0; k < 2; ++k)
        assert_true(ovoid_mesh_component(mesh, k)->outer);
    ovoid_mesh_destroy(&mesh);
}

static void a_ring_has_a_hole(void **state) {
    test_skip_simulated(*state); /* a shape like any other */
    enum { MOST = 14 };
    double xyzr[4 * MOST];
    const size_t ring = test_size(MOST, 11);
    const double wide = (double)ring / MOST;
    const ovoid_mesh_options options = options_of(1.0, coarse(0.5), OVOID_VERTEX_EXACT);
    for (size_t i = 0; i < ring; ++i) {
        const double angle = 2.0 * PI * (double)i / (double)ring;
        xyzr[4 * i] = 5.0 * wide * cos(angle);
        xyzr[4 * i + 1] = wide * (4.0 * sin(angle) + 0.3 * cos(angle));
        xyzr[4 * i + 2] = 3.0 * wide * sin(angle);
        xyzr[4 * i + 3] = 1.4;
    }
    ovoid_mesh *mesh = expect_atoms(*state, xyzr, ring, 0.5, &options, 0, 1);
    assert_true(ovoid_mesh_volume(mesh) > 0.0);
    ovoid_mesh_destroy(&mesh);
}

/* Atoms on a sphere: an outer wall and that of the cavity, whose volume counts negative. */
static void a_hollow_shell_has_two_walls(void **state) {
    test_skip_simulated(*state);
    enum { MOST = 120 };
    double xyzr[4 * MOST];
    const size_t shell = test_size(MOST, 56);
    const double wide = 5.0 * sqrt((double)shell / MOST);
    const ovoid_mesh_options options = options_of(1.0, coarse(0.5), OVOID_VERTEX_EXACT);
    for (size_t i = 0; i < shell; ++i) {
        const double z = (2.0 * (double)i + 1.0) / (double)shell - 1.0,
                     angle = PI * (3.0 - sqrt(5.0)) * (double)i;
        xyzr[4 * i] = wide * sqrt(1.0 - z * z) * cos(angle);
        xyzr[4 * i + 1] = wide * sqrt(1.0 - z * z) * sin(angle);
        xyzr[4 * i + 2] = wide * z;
        xyzr[4 * i + 3] = 1.2;
    }
    ovoid_mesh *mesh = expect_atoms(*state, xyzr, shell, 0.7, &options, 4, 2);
    const ovoid_component *const a = ovoid_mesh_component(mesh, 0), *const b = ovoid_mesh_component(
                                                                        mesh, 1);
    assert_true(a->outer != b->outer);
    assert_true(a->volume * b->volume < 0.0 && ovoid_mesh_volume(mesh) > 0.0);
    ovoid_mesh_destroy(&mesh);
}

static void flat_and_thin_models_stay_closed(void **state) {
    const model_kind kinds[] = {MODEL_NEEDLE, MODEL_PANCAKE, MODEL_RANDOM};
    const double isovalue = 0.3;
    if (test_small())
        skip();
    for (size_t n = 0; n < 3; ++n) {
        test_random random = {7 + n};
        ovoid_ellipsoid ellipsoids[12];
        ovoid_model *model = NULL;
        ovoid_mesh *mesh = NULL;
        const double spacing = kinds[n] == MODEL_PANCAKE ? 1.2 : 0.5;
        const ovoid_mesh_options options = options_of(isovalue, spacing, OVOID_VERTEX_EXACT);
        random_ellipsoids(&random, kinds[n], 4.0, ellipsoids, 12);
        test_check(*state, ovoid_model_create(*state, ellipsoids, 12, 0.5, 1.0, &model));
        test_check(*state, once_model_mesh(*state, model, &options, &mesh));
        print_message("%s: %zu vertices, %zu components\n", model_kind_name(kinds[n]),
                      ovoid_mesh_vertices(mesh), ovoid_mesh_components(mesh));
        expect_closed(mesh);
        ovoid_mesh_destroy(&mesh);
        ovoid_model_destroy(&model);
    }
}

/* The gradient vanishes between two atoms, and the isovalue is phi there. */
static void a_vertex_without_gradient_has_a_normal(void **state) {
    const double xyzr[8] = {-1.75, 0.0, 0.0, 1.5, 1.75, 0.0, 0.0, 1.5}, origin[3] = {0};
    double c;
    ovoid_molecule *molecule = NULL;
    ovoid_mesh *mesh = NULL;
    test_check(*state, ovoid_molecule_create(*state, xyzr, 2, &molecule));
    test_check(*state, once_molecule_field(*state, molecule, 0.5, origin, 1, &c, NULL));
    for (int rule = 0; rule < 2; ++rule) {
        const ovoid_mesh_options options = options_of(c, 0.5, (ovoid_vertex_rule)rule);
        size_t at_origin = 0;
        double sum[3] = {0};
        test_check(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh));
        expect_closed(mesh);
        for (size_t v = 0; v < ovoid_mesh_vertices(mesh); ++v) {
            const double *const y = ovoid_mesh_xyz(mesh) + 3 * v;
            const float *const n = ovoid_mesh_normals(mesh) + 3 * v;
            if (fabs(y[0]) + fabs(y[1]) + fabs(y[2]) < 1e-5) { /* all but there: see march.cl */
                ++at_origin;
                for (int k = 0; k < 3; ++k)
                    sum[k] += n[k];
            }
            expect_near((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2], 1.0, 1e-5,
                        "a normal's square");
        }
        assert_int_equal(at_origin, 2); /* the origin is outside: on the edges to the atoms */
        for (int k = 0; k < 3; ++k)
            expect_near(sum[k], 0.0, 2.0, "the sum of two normals that face each other");
        ovoid_mesh_destroy(&mesh);
    }
    ovoid_molecule_destroy(&molecule);
}

/* ---- against the twin --------------------------------------------------------------------- */

/* Small sharp atoms in a box: every case of the table comes up. */
static ov_body *noise(test_random *random, size_t count, double half, ov_quadric **quadrics) {
    ov_body *const bodies = test_alloc(count, sizeof *bodies);
    *quadrics = test_alloc(count, sizeof **quadrics);
    for (size_t i = 0; i < count; ++i) {
        double xyzr[4];
        for (int k = 0; k < 3; ++k)
            xyzr[k] = random_uniform(random, -half, half);
        xyzr[3] = random_uniform(random, 0.2, 0.5);
        ov_body_of_atom(xyzr, 6.0, &bodies[i]);
        (*quadrics)[i] = bodies[i].quadric;
    }
    return bodies;
}

static int compare_triangles(const void *a, const void *b) {
    return memcmp(a, b, 3 * sizeof(uint32_t));
}

/* Triangles begin with their smallest corner and are sorted. */
static void sort_triangles(uint32_t *corner, size_t triangles) {
    for (uint32_t *t = corner; t < corner + 3 * triangles; t += 3)
        while (t[0] > t[1] || t[0] > t[2]) {
            const uint32_t first = t[0];
            t[0] = t[1];
            t[1] = t[2];
            t[2] = first;
        }
    qsort(corner, triangles, 3 * sizeof *corner, compare_triangles);
}

static void expect_same(const ovoid_mesh *mesh, ov_twin_mesh *wanted, double accuracy) {
    const size_t triangles = ovoid_mesh_triangles(mesh), vertices = ovoid_mesh_vertices(mesh);
    assert_int_equal(vertices, wanted->vertices);
    assert_int_equal(triangles, wanted->triangles);
    uint32_t *const name = test_alloc(vertices, sizeof *name), *const corner = test_alloc(
                                                                   3 * triangles, sizeof *corner);
    bool *const taken = test_alloc(vertices, sizeof *taken);
    for (size_t v = 0; v < vertices; ++v) {
        int64_t low[3];
        size_t point = 0;
        const unsigned axis = edge_of(mesh, v, wanted->spacing, low);
        for (int k = 2; k >= 0; --k) {
            assert_true(low[k] >= wanted->low[k]);
            assert_true((size_t)(low[k] - wanted->low[k]) < wanted->size[k]);
            point = point * wanted->size[k] + (size_t)(low[k] - wanted->low[k]);
        }
        name[v] = wanted->vertex[3 * point + axis];
        assert_true(name[v] != OV_TWIN_NO_VERTEX);
        assert_false(taken[name[v]]);
        taken[name[v]] = true;
        expect_near(ovoid_mesh_xyz(mesh)[3 * v + axis], wanted->xyz[3 * (size_t)name[v] + axis],
                    accuracy * (1.0 + wanted->softness[name[v]]), "a vertex");
    }
    for (size_t k = 0; k < 3 * triangles; ++k)
        corner[k] = name[ovoid_mesh_corners(mesh)[k]];
    sort_triangles(corner, triangles);
    sort_triangles(wanted->corner, triangles);
    assert_memory_equal(corner, wanted->corner, 3 * triangles * sizeof *corner);
    free(name);
    free(corner);
    free(taken);
}

/* Linear vertices in one piece and in many: the twin's mesh. */
static void pieces_give_the_plain_mesh(void **state) {
    static const uint64_t limits[][3] = {OV_MARCH_PIECE, {16, 8, 8}, {8, 16, 24}, {4, 2, 2}};
    const bool simulated = test_simulated(*state);
    const double spacing = 0.4, half = simulated ? 0.7 : test_small() ? 1.4 : 4.0;
    const size_t count = simulated ? 6 : test_size(500, 20), box = test_size(31, 15);
    const int64_t low = -(int64_t)box / 2;
    test_random random = {11};
    ov_quadric *quadrics;
    ov_body *const bodies = noise(&random, count, half, &quadrics);
    const ovoid_mesh_options options = options_of(1.0, spacing, OVOID_VERTEX_LINEAR);
    ov_twin_mesh wanted;
    assert_true(ov_twin_march(quadrics, count, 1.0, spacing, (const int64_t[3]){low, low, low},
                              (const size_t[3]){box, box, box}, &wanted));
    for (size_t k = 0; k < sizeof limits / sizeof limits[0]; ++k) {
        ovoid_mesh *mesh = NULL;
        if (test_small() && k > 1)
            break;
        test_check(*state, ov_march(*state, bodies, count, &options, limits[k], &mesh));
        print_message("%zu vertices, %zu triangles, %zu components\n", ovoid_mesh_vertices(mesh),
                      ovoid_mesh_triangles(mesh), ovoid_mesh_components(mesh));
        expect_closed(mesh);
        expect_same(mesh, &wanted, 1e-5);
        ovoid_mesh_destroy(&mesh);
    }
    ov_twin_mesh_destroy(&wanted);
    free(bodies);
    free(quadrics);
}

/* Both rules give the same edges, in every case of the table and across many pieces. */
static void exact_vertices_stay_on_their_edges(void **state) {
    static const uint64_t limit[3] = {12, 12, 12};
    const bool simulated = test_simulated(*state);
    const double half = simulated ? 0.7 : test_small() ? 1.4 : 5.0;
    const size_t count = simulated ? 6 : test_size(900, 20);
    test_random random = {12};
    ov_quadric *quadrics;
    ov_body *const bodies = noise(&random, count, half, &quadrics);
    const ovoid_mesh_options exact = options_of(0.9, 0.37, OVOID_VERTEX_EXACT),
                             linear = options_of(0.9, 0.37, OVOID_VERTEX_LINEAR);
    ovoid_mesh *mesh = NULL, *other = NULL;
    test_check(*state, ov_march(*state, bodies, count, &exact, limit, &mesh));
    test_check(*state, ov_march(*state, bodies, count, &linear, limit, &other));
    assert_int_equal(expect_surface(mesh, quadrics, count, &exact), expect_closed(other));
    assert_int_equal(ovoid_mesh_vertices(mesh), ovoid_mesh_vertices(other));
    for (size_t v = 0; v < ovoid_mesh_vertices(mesh); ++v)
        for (int k = 0; k < 3; ++k)
            assert_true(fabs(ovoid_mesh_xyz(mesh)[3 * v + (size_t)k] -
                             ovoid_mesh_xyz(other)[3 * v + (size_t)k]) <= 0.37 + 1e-9);
    ovoid_mesh_destroy(&mesh);
    ovoid_mesh_destroy(&other);
    free(bodies);
    free(quadrics);
}

/* ---- lattices ----------------------------------------------------------------------------- */

/* phi is c at many lattice points: a cube of atoms at lattice points, or an edge of it. */
static void values_equal_to_the_isovalue_are_outside(void **state) {
    double xyzr[4 * 8];
    const size_t atoms = test_size(8, 2);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = i >> k & 1 ? 8.0 : 0.0;
        xyzr[4 * i + 3] = 2.0;
    }
    for (int rule = 0; rule < 2; ++rule) {
        const ovoid_mesh_options options = options_of(1.0, 1.0, (ovoid_vertex_rule)rule);
        ovoid_mesh *mesh = mesh_atoms(*state, xyzr, atoms, 0.5, &options);
        assert_int_equal(expect_closed(mesh), 2 * atoms);
        assert_int_equal(ovoid_mesh_components(mesh), atoms);
        double low = INFINITY, high = -INFINITY;
        for (size_t k = 0; k < 3 * ovoid_mesh_vertices(mesh); ++k) {
            low = fmin(low, ovoid_mesh_xyz(mesh)[k]);
            high = fmax(high, ovoid_mesh_xyz(mesh)[k]);
        }
        expect_near(low, -2.0, 1e-5, "the lowest vertex");
        expect_near(high, 10.0, 1e-5, "the highest vertex");
        ovoid_mesh_destroy(&mesh);
    }
}

/* A mesh does not change with the lattice indices of where it lies. */
static void far_from_the_origin(void **state) {
    test_skip_simulated(*state);
    test_random random = {13};
    const double far[3] = {40000.0, -90000.0, 262144.0};
    double here[4 * 10], there[4 * 10];
    const size_t atoms = test_size(10, 4);
    const ovoid_mesh_options options = options_of(1.0, coarse(0.5), OVOID_VERTEX_EXACT);
    for (size_t k = 0; k < 4 * atoms; ++k) {
        here[k] = k % 4 == 3 ? 1.5 : round(random_uniform(&random, -40.0, 40.0)) / 8.0;
        there[k] = k % 4 == 3 ? here[k] : here[k] + far[k % 4];
    }
    ovoid_mesh *a = mesh_atoms(*state, here, atoms, 0.5, &options),
               *b = mesh_atoms(*state, there, atoms, 0.5, &options);
    assert_int_equal(ovoid_mesh_vertices(a), ovoid_mesh_vertices(b));
    assert_int_equal(ovoid_mesh_triangles(a), ovoid_mesh_triangles(b));
    for (size_t k = 0; k < 3 * ovoid_mesh_vertices(a); ++k)
        expect_near(ovoid_mesh_xyz(b)[k] - far[k % 3], ovoid_mesh_xyz(a)[k], 1e-9, "a vertex");
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
}

/* A box of 1e17 lattice points; what is evaluated follows the two atoms. */
static void memory_follows_the_surface(void **state) {
    test_skip_simulated(*state);
    static const uint64_t limits[][3] = {{4, 4, 4}, OV_MARCH_PIECE};
    const double xyzr[8] = {0.0, 0.0, 0.0, 1.5, 2e5, -3e5, 4e5, 1.5};
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    ov_quadric *const quadrics = quadrics_of(xyzr, 2, 0.5);
    ov_body bodies[2];
    for (size_t i = 0; i < 2; ++i)
        ov_body_of_atom(xyzr + 4 * i, 0.5, &bodies[i]);
    for (size_t k = 0; k < test_size(2, 1); ++k) {
        ovoid_mesh *mesh = NULL;
        test_check(*state, ov_march(*state, bodies, 2, &options, limits[k], &mesh));
        assert_int_equal(expect_surface(mesh, quadrics, 2, &options), 4);
        assert_int_equal(ovoid_mesh_components(mesh), 2);
        ovoid_mesh_destroy(&mesh);
    }
    free(quadrics);
}

/* With one atom no piece is there that need not be. Its surface ends now in the first points of a
 * piece, now in the last, and a neighbour has only the other end of the edges. */
static void pieces_reach_as_far_as_the_surface(void **state) {
    enum { BOX = 13 };
    static const uint64_t limit[3] = {4, 2, 2};
    const double spacing = 0.5;
    const int64_t low[3] = {-6, -6, -6};
    const size_t box[3] = {BOX, BOX, BOX};
    const ovoid_mesh_options options = options_of(1.0, spacing, OVOID_VERTEX_LINEAR);
    test_random random = {15};
    test_skip_simulated(*state); /* tips_at_the_ends_of_pieces() has small ones, too */
    for (size_t k = 0; k < test_size(40, 2); ++k) {
        double xyzr[4];
        for (int axis = 0; axis < 3; ++axis)
            xyzr[axis] = random_uniform(&random, -0.8, 0.8);
        xyzr[3] = random_uniform(&random, 0.7, 1.8);
        ov_body body;
        ov_twin_mesh wanted;
        ovoid_mesh *mesh = NULL;
        ov_body_of_atom(xyzr, 0.5, &body);
        assert_true(ov_twin_march(&body.quadric, 1, 1.0, spacing, low, box, &wanted));
        test_check(*state, ov_march(*state, &body, 1, &options, limit, &mesh));
        assert_int_equal(expect_closed(mesh), 2);
        expect_same(mesh, &wanted, 1e-5);
        ovoid_mesh_destroy(&mesh);
        ov_twin_mesh_destroy(&wanted);
    }
}

/* Atoms at lattice points whose surfaces end at lattice points: the first or last of a piece, too,
 * and rounding decides on which side they lie. */
static void tips_at_the_ends_of_pieces(void **state) {
    static const uint64_t limits[][3] = {{4, 2, 2}, {4, 4, 6}, {8, 6, 4}};
    const double decays[] = {0.5, 0.3, 0.77};
    const size_t first = test_simulated(*state) ? 9 : 0; /* with fewer pieces */
    for (size_t k = first; k < first + test_size(27, 1); ++k) {
        const double xyzr[4] = {1.5, -2.0, 0.5, 1.0 + 0.5 * (double)(k % 3)};
        const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
        ov_body body;
        ovoid_mesh *mesh = NULL;
        ov_body_of_atom(xyzr, decays[k / 3 % 3], &body);
        test_check(*state, ov_march(*state, &body, 1, &options, limits[k / 9], &mesh));
        assert_int_equal(expect_closed(mesh), 2);
        ovoid_mesh_destroy(&mesh);
    }
}

static void two_runs_are_the_same(void **state) {
    test_skip_simulated(*state);
    const size_t count = test_size(600, 20);
    const ovoid_mesh_options options = options_of(1.0, 0.4, OVOID_VERTEX_EXACT);
    static const uint64_t limit[3] = {16, 16, 16};
    test_random random = {14};
    ov_quadric *quadrics;
    ov_body *const bodies = noise(&random, count, test_small() ? 1.4 : 5.0, &quadrics);
    ovoid_mesh *a = NULL, *b = NULL;
    test_check(*state, ov_march(*state, bodies, count, &options, limit, &a));
    test_check(*state, ov_march(*state, bodies, count, &options, limit, &b));
    const size_t vertices = ovoid_mesh_vertices(a), triangles = ovoid_mesh_triangles(a);
    assert_int_equal(vertices, ovoid_mesh_vertices(b));
    assert_int_equal(triangles, ovoid_mesh_triangles(b));
    assert_memory_equal(ovoid_mesh_xyz(a), ovoid_mesh_xyz(b), 3 * vertices * sizeof(double));
    assert_memory_equal(ovoid_mesh_normals(a), ovoid_mesh_normals(b), 3 * vertices * sizeof(float));
    assert_memory_equal(ovoid_mesh_corners(a), ovoid_mesh_corners(b),
                        3 * triangles * sizeof(uint32_t));
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    free(bodies);
    free(quadrics);
}

/* A light mesh is the other one in floats, about an origin of the caller's, one vertex without a
 * gradient included; every vertex has a triangle. */
static void light_meshes_are_the_same(void **state) {
    const double xyzr[8] = {-1.75, 0.0, 0.0, 1.5, 1.75, 0.0, 0.0, 1.5}, at[3] = {0};
    const double origin[3] = {0.3, -40.0, 7.0};
    static const uint64_t limit[3] = {16, 16, 16};
    double c;
    ovoid_molecule *molecule = NULL;
    ovoid_mesh *full = NULL, *light = NULL;
    ov_body bodies[2];
    test_check(*state, ovoid_molecule_create(*state, xyzr, 2, &molecule));
    test_check(*state, once_molecule_field(*state, molecule, 0.5, at, 1, &c, NULL));
    ovoid_molecule_destroy(&molecule);
    for (size_t i = 0; i < 2; ++i)
        ov_body_of_atom(xyzr + 4 * i, 0.5, &bodies[i]);
    const ovoid_mesh_options options = options_of(c, coarse(0.5), OVOID_VERTEX_EXACT);
    test_check(*state, ov_march(*state, bodies, 2, &options, limit, &full));
    test_check(*state, ov_march_light(*state, bodies, 2, &options, limit, origin, NULL, &light));
    const size_t vertices = full->vertices, triangles = full->triangles;
    assert_true(full->along_curve && light->along_curve);
    assert_null(light->xyz);
    assert_int_equal(vertices, light->vertices);
    assert_int_equal(triangles, light->triangles);
    assert_memory_equal(full->corners, light->corners, 3 * triangles * sizeof *full->corners);
    bool *const used = test_alloc(vertices, sizeof *used);
    for (size_t k = 0; k < 3 * triangles; ++k)
        used[full->corners[k]] = true;
    for (size_t k = 0; k < 3 * vertices; ++k) {
        assert_true(used[k / 3]);
        expect_near(light->offsets[k], full->xyz[k] - origin[k % 3], 4e-6, "an offset");
        expect_near(light->normals[k], full->normals[k], 1e-5, "a normal");
    }
    free(used);
    ovoid_mesh_destroy(&full);
    ovoid_mesh_destroy(&light);
}

/* What the device has of a mesh is the mesh. */
static void expect_on_device(ovoid_context *context, const ovoid_mesh *mesh) {
    const size_t values = 3 * mesh->vertices, corners = 3 * mesh->triangles;
    assert_non_null(mesh->on_device[OV_ON_DEVICE_OFFSETS].memory);
    float *const offsets = read_floats(context, &mesh->on_device[OV_ON_DEVICE_OFFSETS], values);
    float *const numbers = read_floats(context, &mesh->on_device[OV_ON_DEVICE_CORNERS], corners);
    assert_memory_equal(offsets, mesh->offsets, values * sizeof *offsets);
    assert_memory_equal(numbers, mesh->corners, corners * sizeof *mesh->corners);
    free(offsets);
    free(numbers);
}

/* One marcher, one mesh after the other, small, larger, with a speck, in several pieces: each is
 * what a marcher of its own makes; and on the device, too, unless it has grown too much or its
 * specks come from the host. */
static void light_meshes_stay_on_the_device(void **state) {
    const double origin[3] = {1.0, 2.0, -3.0};
    const struct {
        double xyzr[8];
        size_t atoms;
        bool there, alone; /* on the device, and after the first mesh of a marcher */
    } cases[] = {{{0, 0, 0, 1.5}, 1, true, true},
                 {{0, 0, 0, 1.55}, 1, true, true},
                 {{0, 0, 0, 1.5, 3.0, 0.4, 0.1, 2.0}, 2, true, true},
                 {{0.2, 0.2, 0.2, 1.5, 9.2, 0.2, 0.2, 0.2}, 2, false, false},
                 {{-70.0, 0, 0, 1.5, 71.0, 0, 0, 1.6}, 2, true, false}};
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    ov_marcher *marcher = NULL;
    test_check(*state, ov_marcher_create(*state, &marcher));
    for (size_t n = 0; n < test_size(sizeof cases / sizeof *cases, 2); ++n) {
        ov_body bodies[2];
        ovoid_mesh *mesh = NULL, *own = NULL;
        ov_marcher *fresh = NULL;
        for (size_t i = 0; i < cases[n].atoms; ++i)
            ov_body_of_atom(cases[n].xyzr + 4 * i, 0.5, &bodies[i]);
        test_check(*state, ov_mesh_bodies_light(*state, marcher, bodies, cases[n].atoms, &options,
                                                origin, NULL, n % 2 == 0, &mesh));
        test_check(*state, ov_marcher_create(*state, &fresh));
        test_check(*state, ov_mesh_bodies_light(*state, fresh, bodies, cases[n].atoms, &options,
                                                origin, NULL, true, &own));
        print_message("%zu vertices, %zu triangles, %s\n", mesh->vertices, mesh->triangles,
                      mesh->on_device[0].memory ? "on the device" : "not on the device");
        assert_int_equal(mesh->vertices, own->vertices);
        assert_int_equal(mesh->triangles, own->triangles);
        assert_memory_equal(mesh->offsets, own->offsets, 3 * mesh->vertices * sizeof(float));
        assert_memory_equal(mesh->corners, own->corners, 3 * mesh->triangles * sizeof(uint32_t));
        assert_true((mesh->normals == NULL) == (n % 2 != 0));
        if (mesh->normals)
            assert_memory_equal(mesh->normals, own->normals, 3 * mesh->vertices * sizeof(float));
        assert_true((mesh->on_device[0].memory != NULL) == cases[n].there);
        assert_true((own->on_device[0].memory != NULL) == cases[n].alone);
        if (cases[n].there)
            expect_on_device(*state, mesh);
        ovoid_mesh_destroy(&mesh);
        ovoid_mesh_destroy(&own);
        ov_marcher_destroy(&fresh);
    }
    ov_marcher_destroy(&marcher);
}

/* ---- specks ------------------------------------------------------------------------------- */

/* A small sphere, wherever it lies between the lattice's points: one piece, with its area. */
static void small_spheres_have_their_area(void **state) {
    test_skip_simulated(*state);
    static const double radii[] = {0.01, 0.05, 0.2, 0.4, 0.45, 0.6, 0.9, 1.1};
    test_random random = {21};
    for (size_t k = 0; k < test_size(sizeof radii / sizeof *radii, 3); ++k)
        for (int n = 0; n < (test_small() ? 1 : 6); ++n) {
            const ovoid_mesh_options options =
                options_of(1.0, 0.5, n % 2 ? OVOID_VERTEX_LINEAR : OVOID_VERTEX_EXACT);
            const double atom[4] = {random_uniform(&random, -50.0, 50.0),
                                    random_uniform(&random, -50.0, 50.0),
                                    n == 0 ? 0.0 : random_uniform(&random, -50.0, 50.0), radii[k]};
            ovoid_mesh *mesh = mesh_atoms(*state, atom, 1, 0.5, &options);
            const double wanted = 4.0 * PI * radii[k] * radii[k];
            assert_int_equal(expect_closed(mesh), 2);
            if (options.vertices == OVOID_VERTEX_EXACT)
                expect_near(ovoid_mesh_smooth_area(mesh) / wanted, 1.0, 1e-3, "an area");
            expect_near(ovoid_mesh_area(mesh) / wanted, 1.0, 0.06, "a flat area");
            ovoid_mesh_destroy(&mesh);
        }
}

/* Far apart, one of them at a lattice point and others between: each is one piece, and none twice.
 */
static void specks_are_found_once(void **state) {
    test_skip_simulated(*state);
    enum { SIDE = 6, ATOMS = SIDE * SIDE * SIDE };
    static double xyzr[4 * ATOMS];
    const size_t atoms = test_size(ATOMS, 4);
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    const double area = 4.0 * PI * 0.04;
    for (size_t i = 0; i < atoms; ++i) {
        const double at[4] = {10.27 * (double)(i % SIDE), 10.41 * (double)(i / SIDE % SIDE),
                              9.93 * (double)(i / (SIDE * SIDE)), 0.2};
        memcpy(xyzr + 4 * i, at, sizeof at);
    }
    ovoid_mesh *mesh = mesh_atoms(*state, xyzr, atoms, 0.5, &options);
    assert_int_equal(ovoid_mesh_components(mesh), atoms);
    assert_int_equal(expect_closed(mesh), 2 * (int64_t)atoms);
    expect_near(ovoid_mesh_smooth_area(mesh), (double)atoms * area, 1e-3 * (double)atoms * area,
                "the area of all");
    ovoid_mesh_destroy(&mesh);
}

/* Beside large atoms: a speck of its own, and one that has grown together with its neighbour; two
 * that are one; as a fine lattice has them. */
static void specks_beside_others(void **state) {
    static const double apart[] = {0.0, 0.0, 0.0, 1.7, 3.41, 0.3, 0.2, 0.25},
                        grown[] = {0.0, 0.0, 0.0, 1.7, 1.8, 0.3, 0.2, 0.25},
                        twins[] = {0.2, 0.2, 0.2, 0.2, 0.5, 0.2, 0.3, 0.15},
                        triple[] = {0.2, 0.2, 0.2, 0.3, 0.9, 0.2, 0.3, 0.15, 7.0, 7.0, 7.2, 0.3};
    static const struct {
        const double *xyzr;
        size_t atoms, pieces;
    } cases[] = {{apart, 2, 2}, {grown, 2, 1}, {twins, 2, 1}, {triple, 3, 2}};
    if (test_small())
        skip();
    for (size_t k = 0; k < sizeof cases / sizeof *cases; ++k) {
        const ovoid_mesh_options coarse_one = options_of(1.0, 0.5, OVOID_VERTEX_EXACT),
                                 fine = options_of(1.0, 0.03, OVOID_VERTEX_EXACT);
        ovoid_mesh *mesh = mesh_atoms(*state, cases[k].xyzr, cases[k].atoms, 0.5, &coarse_one),
                   *other = mesh_atoms(*state, cases[k].xyzr, cases[k].atoms, 0.5, &fine);
        assert_int_equal(ovoid_mesh_components(mesh), cases[k].pieces);
        assert_int_equal(ovoid_mesh_components(other), cases[k].pieces);
        assert_int_equal(expect_closed(mesh), 2 * (int64_t)cases[k].pieces);
        expect_near(ovoid_mesh_smooth_area(mesh) / ovoid_mesh_smooth_area(other), 1.0, 2e-3,
                    "the area on a fine lattice");
        ovoid_mesh_destroy(&mesh);
        ovoid_mesh_destroy(&other);
    }
}

static void small_ellipsoids_have_their_volume(void **state) {
    test_skip_simulated(*state);
    const ovoid_ellipsoid two[] = {{.amplitude = 2.0,
                                    .decay = {60.0, 25.0, 9.0},
                                    .centre = {3.3, 0.2, 0.1},
                                    .angle = {0.7, -1.1, 2.0}},
                                   {.amplitude = 1.01,
                                    .decay = {0.5, 0.3, 0.2},
                                    .centre = {-30.0, 4.0, 0.0},
                                    .angle = {0.1, 0.2, 0.3}}};
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    ovoid_model *model = NULL;
    ovoid_mesh *mesh = NULL;
    double volume = 0.0;
    for (int i = 0; i < 2; ++i)
        volume += 4.0 / 3.0 * PI * pow(log(two[i].amplitude), 1.5) /
                  sqrt(two[i].decay[0] * two[i].decay[1] * two[i].decay[2]);
    test_check(*state, ovoid_model_create(*state, two, 2, 0.5, 1.0, &model));
    test_check(*state, once_model_mesh(*state, model, &options, &mesh));
    assert_int_equal(ovoid_mesh_components(mesh), 2);
    assert_int_equal(expect_closed(mesh), 4);
    expect_near(ovoid_mesh_smooth_volume(mesh) / volume, 1.0, 3e-3, "volume");
    ovoid_mesh_destroy(&mesh);
    ovoid_model_destroy(&model);
}

static void keep_text(const char *text, void *user) {
    snprintf(user, 256, "%s", text);
}

/* What is too small for any lattice is counted, and there is no other warning. */
static void what_is_missed_is_counted(void **state) {
    test_skip_simulated(*state);
    const double xyzr[] = {0.1, 0.2, 0.3, 1.5, 9.013, 0.021, 0.037, 1e-5, 0.1, 9.2, 0.3, 0.3};
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    char text[256] = "";
    ovoid_context_on_warning(*state, keep_text, text);
    ovoid_mesh *mesh = mesh_atoms(*state, xyzr, 1, 0.5, &options);
    assert_string_equal(text, "");
    ovoid_mesh_destroy(&mesh);
    mesh = mesh_atoms(*state, xyzr, 3, 0.5, &options);
    ovoid_context_on_warning(*state, NULL, NULL);
    assert_non_null(strstr(text, "1 atom or ellipsoid makes a surface too small or too thin"));
    assert_int_equal(ovoid_mesh_components(mesh), 2);
    ovoid_mesh_destroy(&mesh);
}

/* What is not small is left as the lattice has it, at any isovalue: none of a protein's atoms, each
 * of which is small where the isovalue is nearly its Gaussian's height. */
static void large_pieces_are_left_alone(void **state) {
    ovoid_molecule *molecule = NULL;
    if (test_small() || access(APBS_FAS2, R_OK) != 0) {
        print_message("no " APBS_FAS2 ", or small tests; install apbs-data\n");
        skip();
    }
    test_check(*state, ovoid_molecule_read(*state, APBS_FAS2, OVOID_MOLECULE_AUTO, &molecule));
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ov_body *const bodies = test_alloc(atoms, sizeof *bodies);
    for (size_t i = 0; i < atoms; ++i)
        ov_body_of_atom(ovoid_molecule_xyzr(molecule) + 4 * i, 0.5, &bodies[i]);
    for (int k = 0; k < 3; ++k) {
        const ovoid_mesh_options options =
            options_of((double[]){1.0, 3.0, 4.0}[k], 0.5, OVOID_VERTEX_EXACT);
        ovoid_mesh *plain = NULL, *mesh = NULL;
        test_check(*state, ov_march(*state, bodies, atoms, &options, whole, &plain));
        test_check(*state, ov_mesh_bodies(*state, NULL, bodies, atoms, &options, &mesh));
        assert_int_equal(mesh->missed, 0);
        assert_int_equal(ovoid_mesh_components(mesh), ovoid_mesh_components(plain));
        expect_near(ovoid_mesh_smooth_area(mesh) / ovoid_mesh_smooth_area(plain), 1.0, 1e-4,
                    "the area");
        ovoid_mesh_destroy(&plain);
        ovoid_mesh_destroy(&mesh);
    }
    free(bodies);
    ovoid_molecule_destroy(&molecule);
}

/* Atoms without neighbours, as far apart as coordinates allow: work for each, none for the
 * space between. */
static void atoms_far_apart(void **state) {
    test_skip_simulated(*state);
    enum { ATOMS = 60 };
    double xyzr[4 * ATOMS];
    test_random random = {31};
    const size_t atoms = test_size(ATOMS, 2);
    const ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -1e6, 1e6);
        xyzr[4 * i + 3] = 1.7;
    }
    ovoid_mesh *mesh = mesh_atoms(*state, xyzr, atoms, 0.5, &options);
    assert_int_equal(ovoid_mesh_components(mesh), atoms);
    assert_int_equal(expect_closed(mesh), 2 * (int64_t)atoms);
    expect_near(ovoid_mesh_smooth_area(mesh) / ((double)atoms * 4.0 * PI * 1.7 * 1.7), 1.0, 1e-3,
                "area");
    ovoid_mesh_destroy(&mesh);
}

/* ---- a protein ---------------------------------------------------------------------------- */

static bool file_exists(const char *path) {
    FILE *const file = fopen(path, "rb");
    if (file)
        fclose(file);
    return file != NULL;
}

static void a_protein_is_closed(void **state) {
    ovoid_molecule *molecule = NULL;
    if (test_small() || !file_exists(APBS_FAS2)) {
        print_message("no " APBS_FAS2 ", or small tests; install apbs-data\n");
        skip();
    }
    test_check(*state, ovoid_molecule_read(*state, APBS_FAS2, OVOID_MOLECULE_AUTO, &molecule));
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ov_quadric *const quadrics = quadrics_of(ovoid_molecule_xyzr(molecule), atoms, 0.5);
    static const uint64_t limit[3] = {40, 40, 40};
    ov_body *const bodies = test_alloc(atoms, sizeof *bodies);
    for (size_t i = 0; i < atoms; ++i)
        ov_body_of_atom(ovoid_molecule_xyzr(molecule) + 4 * i, 0.5, &bodies[i]);
    for (int rule = 0; rule < 2; ++rule) {
        const ovoid_mesh_options options = options_of(1.0, 0.5, (ovoid_vertex_rule)rule);
        ovoid_mesh *one = NULL, *many = NULL;
        test_check(*state, ov_march(*state, bodies, atoms, &options, whole, &one));
        test_check(*state, ov_march(*state, bodies, atoms, &options, limit, &many));
        const int64_t euler = expect_surface(one, quadrics, atoms, &options);
        assert_int_equal(expect_closed(many), euler);
        assert_int_equal(ovoid_mesh_vertices(one), ovoid_mesh_vertices(many));
        assert_int_equal(ovoid_mesh_components(one), ovoid_mesh_components(many));
        expect_near(ovoid_mesh_volume(many), ovoid_mesh_volume(one), 1e-6 * ovoid_mesh_volume(one),
                    "volume");
        expect_near(ovoid_mesh_area(many), ovoid_mesh_area(one), 1e-6 * ovoid_mesh_area(one),
                    "area");
        assert_true(ovoid_mesh_volume(one) > 0.0);
        ovoid_mesh_destroy(&one);
        ovoid_mesh_destroy(&many);
    }
    free(quadrics);
    free(bodies);
    ovoid_molecule_destroy(&molecule);
}

/* ---- refusals ----------------------------------------------------------------------------- */

static void refusals(void **state) {
    const double xyzr[4] = {0.2, 0.1, 0.3, 1.5};
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_mesh *mesh = NULL;
    const ovoid_ellipsoid huge = {.amplitude = 1e200, .decay = {1.0, 1.0, 1.0}};
    ovoid_mesh_options options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    test_check(*state, ovoid_molecule_create(*state, xyzr, 1, &molecule));
    test_check(*state, ovoid_model_create(*state, &huge, 1, 0.5, 1.0, &model));
    ovoid_mesh_options_init(NULL, sizeof options);
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, NULL, &mesh),
                 OVOID_ERROR_ARGUMENT, "NULL");
    test_refused(*state, once_model_mesh(*state, NULL, &options, &mesh), OVOID_ERROR_ARGUMENT,
                 "NULL");
    test_refused(*state, once_molecule_mesh(*state, molecule, -0.5, &options, &mesh),
                 OVOID_ERROR_ARGUMENT, "decay");
    const double bad[] = {0.0, -1.0, NAN, INFINITY};
    for (size_t k = 0; k < 4; ++k) {
        options =
            options_of(bad[k] == 0.0 ? -0.5 : bad[k], 0.5, OVOID_VERTEX_EXACT); /* 0: default */
        test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                     OVOID_ERROR_ARGUMENT, "isovalue");
        options = options_of(1.0, bad[k], OVOID_VERTEX_EXACT);
        test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                     OVOID_ERROR_ARGUMENT, "spacing");
    }
    options = options_of(1.0, 0.5, (ovoid_vertex_rule)7);
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_ARGUMENT, "vertex rule");
    options = options_of(50.0, 0.5, OVOID_VERTEX_EXACT);
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_EMPTY, "nowhere above the isovalue 50");
    options = options_of(3.0, 1000.0, OVOID_VERTEX_EXACT);
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_EMPTY, "largest value of the field at a lattice point is 2.87");
    options = options_of(1.0, 5e-4, OVOID_VERTEX_EXACT);
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_LIMIT,
                 "points at a spacing of 0.0005 angstrom, more than 2e+10; use a");
    options = options_of(0.999, 0.5, OVOID_VERTEX_EXACT);
    test_refused(*state, once_molecule_mesh(*state, molecule, 1e-9, &options, &mesh),
                 OVOID_ERROR_LIMIT, "points at a spacing of 0.5 angstrom, more than 2e+10; use a");
    const double spacings[] = {1e-5, 1e-9, 1e-300};
    for (size_t k = 0; k < 3; ++k) {
        options = options_of(1.0, spacings[k], OVOID_VERTEX_EXACT);
        test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                     OVOID_ERROR_LIMIT, "spacing");
    }
    options = options_of(1.0, 0.5, OVOID_VERTEX_EXACT);
    test_refused(*state, once_model_mesh(*state, model, &options, &mesh), OVOID_ERROR_NUMERIC,
                 "ellipsoid 1 is degenerate");
    assert_null(mesh);
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loops_are_closed_and_face_outward),
        cmocka_unit_test(triangles_fill_the_loops),
        cmocka_unit_test(neighbours_agree_on_their_face),
        cmocka_unit_test(one_atom_is_a_sphere),
        cmocka_unit_test(spheres_and_ellipsoids_have_their_measures),
        cmocka_unit_test(two_spheres),
        cmocka_unit_test(a_ring_has_a_hole),
        cmocka_unit_test(a_hollow_shell_has_two_walls),
        cmocka_unit_test(flat_and_thin_models_stay_closed),
        cmocka_unit_test(a_vertex_without_gradient_has_a_normal),
        cmocka_unit_test(pieces_give_the_plain_mesh),
        cmocka_unit_test(exact_vertices_stay_on_their_edges),
        cmocka_unit_test(values_equal_to_the_isovalue_are_outside),
        cmocka_unit_test(far_from_the_origin),
        cmocka_unit_test(memory_follows_the_surface),
        cmocka_unit_test(pieces_reach_as_far_as_the_surface),
        cmocka_unit_test(tips_at_the_ends_of_pieces),
        cmocka_unit_test(two_runs_are_the_same),
        cmocka_unit_test(light_meshes_are_the_same),
        cmocka_unit_test(light_meshes_stay_on_the_device),
        cmocka_unit_test(small_spheres_have_their_area),
        cmocka_unit_test(specks_are_found_once),
        cmocka_unit_test(specks_beside_others),
        cmocka_unit_test(small_ellipsoids_have_their_volume),
        cmocka_unit_test(what_is_missed_is_counted),
        cmocka_unit_test(large_pieces_are_left_alone),
        cmocka_unit_test(atoms_far_apart),
        cmocka_unit_test(a_protein_is_closed),
        cmocka_unit_test(refusals),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
