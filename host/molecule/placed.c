/*
 * Assemblies from memory: a unit and its placements.
 */
#include "base/rigid.h"
#include "molecule/assembly.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static ovoid_status fail(ovoid_context *context, const char *what, size_t n, const char *why) {
    return ov_fail(context, OVOID_ERROR_ARGUMENT,
                   "ovoid_molecule_create_placed: %s %zu (from 0) %s", what, n, why);
}

static bool is_ascending(const ovoid_unit_part *part, size_t atoms) {
    for (size_t i = 0; part->atoms && i < part->count; i++)
        if (part->atoms[i] >= atoms || (i > 0 && part->atoms[i] <= part->atoms[i - 1]))
            return false;
    return part->count > 0;
}

static ovoid_status copy_parts(ovoid_context *context, const ovoid_unit_part *parts, size_t count,
                               ovoid_molecule *m) {
    ovoid_status status = OVOID_OK;
    m->parts = ov_alloc(context, count, sizeof *m->parts, "parts of an assembly");
    if (!m->parts)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < count; p++) {
        ov_part *const part = &m->parts[m->part_count++];
        if (!is_ascending(&parts[p], m->atoms) || (!parts[p].atoms && parts[p].count != m->atoms))
            OV_TRY(fail(context, "part", p, "has to be ascending numbers of the unit's atoms"));
        part->atoms = parts[p].count;
        if (parts[p].atoms) {
            part->index = ov_copy(context, parts[p].atoms, part->atoms, sizeof *part->index,
                                  "parts of an assembly");
            status = part->index ? OVOID_OK : OVOID_ERROR_MEMORY;
        }
    }
cleanup:
    return status;
}

/* Farthest that an atom of the unit is from the origin. */
static double reach(const ovoid_molecule *m) {
    double most = 0.0;
    for (size_t i = 0; i < m->atoms; i++) {
        const double *const p = m->xyzr + 4 * i;
        most = fmax(most, p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    }
    return sqrt(most);
}

static ovoid_status copy_placements(ovoid_context *context, const ovoid_placement *placements,
                                    size_t count, ovoid_molecule *m) {
    ovoid_status status = OVOID_OK;
    const double far = reach(m);
    uint64_t total = 0;
    m->placements = ov_copy(context, placements, count, sizeof *placements, "placements");
    if (!m->placements)
        return OVOID_ERROR_MEMORY;
    m->placement_count = count;
    for (size_t n = 0; n < count; n++) {
        ovoid_placement *const one = &m->placements[n];
        const double *const t = one->translation;
        if (one->part >= m->part_count)
            OV_TRY(fail(context, "placement", n, "is of a part that there is not"));
        if (!ov_is_rotation(one->rotation, 1e-2))
            OV_TRY(fail(context, "placement", n, "is no rotation and translation"));
        if (!(1.1 * far + sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) <= OV_COORDINATE_LIMIT))
            OV_TRY(fail(context, "placement", n, "takes atoms beyond 1e6 angstrom"));
        one->first = total;
        total += m->parts[one->part].atoms;
    }
    if (total > UINT32_MAX)
        OV_TRY(ov_fail(context, OVOID_ERROR_LIMIT, "an assembly of %llu atoms, more than %u",
                       (unsigned long long)total, UINT32_MAX));
    m->all_atoms = (size_t)total;
    m->counts.atoms = total;
cleanup:
    return status;
}

ovoid_status ovoid_molecule_create_placed(ovoid_context *context, const double *xyzr, size_t atoms,
                                          const ovoid_unit_part *parts, size_t part_count,
                                          const ovoid_placement *placements, size_t placement_count,
                                          ovoid_molecule **molecule) {
    ovoid_status status = OVOID_OK;
    ovoid_molecule *made = NULL;
    const ovoid_unit_part whole = {NULL, atoms};
    OV_NEED(context, context);
    OV_NEED(context, placements);
    OV_NEED(context, molecule);
    if (atoms > 0)
        OV_NEED(context, xyzr);
    if (part_count > 0)
        OV_NEED(context, parts);
    if (placement_count == 0)
        return ov_fail(context, OVOID_ERROR_EMPTY, "ovoid_molecule_create_placed: no placements");
    OV_TRY(ovoid_molecule_create(context, xyzr, atoms, &made));
    OV_TRY(copy_parts(context, part_count > 0 ? parts : &whole, part_count > 0 ? part_count : 1,
                      made));
    OV_TRY(copy_placements(context, placements, placement_count, made));
    *molecule = made;
    made = NULL;
cleanup:
    ovoid_molecule_destroy(&made);
    return status;
}
