#include "selftest/twin_march.h"

#include "mesh/case_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t point_number(const ov_twin_mesh *mesh, const size_t at[3]) {
    return (at[2] * mesh->size[1] + at[1]) * mesh->size[0] + at[0];
}

static void point_position(const ov_twin_mesh *mesh, size_t point, double y[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        y[axis] = (double)(mesh->low[axis] + (int64_t)(point % mesh->size[axis])) * mesh->spacing;
        point /= mesh->size[axis];
    }
}

static size_t stride(const ov_twin_mesh *mesh, unsigned axis) {
    return axis == 0 ? 1 : axis == 1 ? mesh->size[0] : mesh->size[0] * mesh->size[1];
}

static void add_vertex(ov_twin_mesh *mesh, size_t point, unsigned axis, double isovalue) {
    const double a = mesh->phi[point], b = mesh->phi[point + stride(mesh, axis)];
    if ((a > isovalue) == (b > isovalue))
        return;
    const size_t v = mesh->vertices++;
    mesh->vertex[3 * point + axis] = (uint32_t)v;
    point_position(mesh, point, mesh->xyz + 3 * v);
    mesh->xyz[3 * v + axis] += mesh->spacing * (isovalue - a) / (b - a);
    mesh->softness[v] = mesh->spacing * fmax(a, b) / fabs(b - a);
}

static void add_cell(ov_twin_mesh *mesh, const ov_case_table *table, size_t point,
                     double isovalue) {
    unsigned index = 0;
    size_t corner[8];
    for (unsigned k = 0; k < 8; ++k) {
        corner[k] = point + (k & 1) * stride(mesh, 0) + (k >> 1 & 1) * stride(mesh, 1) +
                    (k >> 2) * stride(mesh, 2);
        index |= (unsigned)(mesh->phi[corner[k]] > isovalue) << k;
    }
    const uint8_t *const entry = table->entry[index];
    for (unsigned k = 1; k <= 3u * entry[0]; ++k)
        mesh->corner[3 * mesh->triangles + k - 1] =
            mesh->vertex[3 * corner[entry[k] % 8] + entry[k] / 8];
    mesh->triangles += entry[0];
}

bool ov_twin_march(const ov_quadric *quadrics, size_t count, double isovalue, double spacing,
                   const int64_t low[3], const size_t size[3], ov_twin_mesh *mesh) {
    const size_t points = size[0] * size[1] * size[2];
    size_t at[3];
    ov_case_table table;
    ov_case_table_make(&table);
    *mesh = (ov_twin_mesh){.spacing = spacing};
    memcpy(mesh->low, low, sizeof mesh->low);
    memcpy(mesh->size, size, sizeof mesh->size);
    mesh->phi = calloc(points, sizeof *mesh->phi);
    mesh->vertex = calloc(3 * points, sizeof *mesh->vertex);
    mesh->xyz = calloc(9 * points, sizeof *mesh->xyz);
    mesh->softness = calloc(3 * points, sizeof *mesh->softness);
    mesh->corner = calloc(3 * OV_CASE_TRIANGLES * points, sizeof *mesh->corner);
    if (!mesh->phi || !mesh->vertex || !mesh->xyz || !mesh->softness || !mesh->corner) {
        ov_twin_mesh_destroy(mesh);
        return false;
    }
    for (size_t p = 0; p < points; ++p) {
        double y[3];
        point_position(mesh, p, y);
        mesh->phi[p] = ov_twin_field(quadrics, count, y).value;
    }
    for (size_t k = 0; k < 3 * points; ++k)
        mesh->vertex[k] = OV_TWIN_NO_VERTEX;
    for (at[2] = 0; at[2] < size[2]; ++at[2])
        for (at[1] = 0; at[1] < size[1]; ++at[1])
            for (at[0] = 0; at[0] < size[0]; ++at[0])
                for (unsigned axis = 0; axis < 3; ++axis)
                    if (at[axis] + 1 < size[axis])
                        add_vertex(mesh, point_number(mesh, at), axis, isovalue);
    for (at[2] = 0; at[2] + 1 < size[2]; ++at[2])
        for (at[1] = 0; at[1] + 1 < size[1]; ++at[1])
            for (at[0] = 0; at[0] + 1 < size[0]; ++at[0])
                add_cell(mesh, &table, point_number(mesh, at), isovalue);
    return true;
}

void ov_twin_mesh_destroy(ov_twin_mesh *mesh) {
    free(mesh->phi);
    free(mesh->vertex);
    free(mesh->xyz);
    free(mesh->softness);
    free(mesh->corner);
    memset(mesh, 0, sizeof *mesh);
}
