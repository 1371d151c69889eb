/* Coordinates in single precision, for the formats that have no other. */
#include "write/mesh_file.h"

#include "mesh/march.h"
#include "mesh/mesh.h"

#include <float.h>
#include <math.h>

/* Steps of a float within one of the lattice, at least, for a mesh to look as it should. */
#define STEPS_FINE 512.0
/* And for its vertices to stay apart: each keeps one from the ends of its edge. */
#define STEPS_LEAST 8.0

static double edge_spacing(const ovoid_mesh *mesh, size_t vertex) {
    return ldexp(mesh->spacing, -(int)(mesh->edge[vertex] >> OV_EDGE_AXIS_BITS));
}

static double finest_spacing(const ovoid_mesh *mesh) {
    double finest = mesh->edge ? mesh->spacing : 0.0;
    for (size_t v = 0; mesh->edge && v < mesh->vertices; ++v) {
        ov_store_turn(mesh->store, v);
        finest = fmin(finest, edge_spacing(mesh, v));
    }
    return finest;
}

static double furthest(const ovoid_mesh *mesh, const double origin[3]) {
    double most = 0.0;
    for (size_t k = 0; k < 3 * mesh->vertices; ++k) {
        ov_store_turn(mesh->store, k);
        most = fmax(most, fabs(mesh->xyz[k] - origin[k % 3]));
    }
    return most;
}

/* From a float of this size to the next one. */
static double float_step(double size) {
    return size > 0.0 ? ldexp(1.0, ilogb(size) - (FLT_MANT_DIG - 1)) : 0.0;
}

static bool has_steps(const ovoid_mesh *mesh, const double origin[3], double steps) {
    const double finest = finest_spacing(mesh);
    return finest == 0.0 || steps * float_step(furthest(mesh, origin)) <= finest;
}

bool ov_mesh_floats_are_fine(const ovoid_mesh *mesh, const double origin[3]) {
    return has_steps(mesh, origin, STEPS_FINE);
}

bool ov_mesh_floats_suffice(const ovoid_mesh *mesh, const double origin[3]) {
    return has_steps(mesh, origin, STEPS_LEAST);
}

void ov_mesh_middle(const ovoid_mesh *mesh, double middle[3]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        double low = mesh->xyz[axis], high = low;
        for (size_t v = 1; v < mesh->vertices; ++v) {
            ov_store_turn(mesh->store, v);
            low = fmin(low, mesh->xyz[3 * v + axis]);
            high = fmax(high, mesh->xyz[3 * v + axis]);
        }
        middle[axis] = round(0.5 * (low + high));
    }
}

void ov_mesh_float_at(const ovoid_mesh *mesh, size_t vertex, const double origin[3], float at[3]) {
    const double *const xyz = mesh->xyz + 3 * vertex;
    for (size_t axis = 0; axis < 3; ++axis)
        at[axis] = (float)(xyz[axis] - origin[axis]);
    if (!mesh->edge)
        return;
    const unsigned along = mesh->edge[vertex] & OV_EDGE_AXES;
    const double spacing = edge_spacing(mesh, vertex), index = floor(xyz[along] / spacing);
    const float low = (float)(index * spacing - origin[along]),
                high = (float)((index + 1.0) * spacing - origin[along]);
    if (at[along] <= low)
        at[along] = nextafterf(low, high);
    else if (at[along] >= high)
        at[along] = nextafterf(high, low);
}

int ov_mesh_digits(const ovoid_mesh *mesh) {
    const double origin[3] = {0.0, 0.0, 0.0}, finest = finest_spacing(mesh);
    enum { LEAST = 7, MOST = 17 };
    if (finest == 0.0)
        return MOST;
    const double digits = ceil(log10(furthest(mesh, origin) / (0.25 * OV_EDGE_MARGIN * finest)));
    return (int)fmin(fmax(digits, LEAST), MOST);
}
