#include "fit/parts/record.h"

#include <string.h>

static size_t owners_of(const ov_record *r) {
    return r->ellipsoids > 0 ? (size_t)r->atoms : 0;
}

static uint64_t hash_of(const ov_record *r, const ov_found *found) {
    ov_record plain = *r;
    plain.hash = 0;
    const uint64_t hash = ov_hash_with(ov_hash(&plain, sizeof plain), found->quadrics,
                                       found->count * sizeof *found->quadrics);
    return ov_hash_with(hash, found->owner, owners_of(r) * sizeof *found->owner);
}

static ov_record record_of(size_t part, size_t atoms, const ov_part_fit *fit) {
    const ovoid_fit_result *const result = &fit->result;
    ov_record r;
    memset(&r, 0, sizeof r); /* its hash is of all bytes */
    r.part = part;
    r.ellipsoids = fit->found.count;
    r.atoms = atoms;
    r.points = result->points;
    r.iterations = result->iterations;
    r.solver_iterations = result->adaptive.solver_iterations;
    memcpy(r.counts, result->counts, sizeof r.counts);
    r.spacing = result->spacing;
    r.distance = result->distance;
    r.verdict = (uint64_t)result->verdict;
    r.hash = hash_of(&r, &fit->found);
    return r;
}

static void tell(const ov_record *r, ovoid_fit_result *result) {
    ovoid_fit_result_init(result, sizeof *result);
    result->method = OVOID_METHOD_ADAPTIVE;
    result->ellipsoids = r->ellipsoids;
    result->points = r->points;
    result->iterations = r->iterations;
    result->adaptive.solver_iterations = r->solver_iterations;
    memcpy(result->counts, r->counts, sizeof r->counts);
    result->spacing = r->spacing;
    result->distance = r->distance;
    result->verdict = (ovoid_verdict)r->verdict;
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
}

ovoid_status ov_record_put(ovoid_context *context, size_t part, size_t atoms,
                           const ov_part_fit *fit, ov_bytes *to) {
    ovoid_status status = OVOID_OK;
    const ov_record r = record_of(part, atoms, fit);
    const ov_found *const found = &fit->found;
    OV_TRY(ov_bytes_put(context, to, &r, sizeof r));
    OV_TRY(ov_bytes_put(context, to, found->quadrics, found->count * sizeof *found->quadrics));
    OV_TRY(ov_bytes_put(context, to, found->owner, owners_of(&r) * sizeof *found->owner));
cleanup:
    return status;
}

bool ov_record_is_sound(const ov_record *record) {
    return record->atoms <= UINT32_MAX && record->ellipsoids <= 2 * record->atoms + 2;
}

size_t ov_record_rest(const ov_record *record) {
    return (size_t)record->ellipsoids * sizeof(ov_quadric) + owners_of(record) * sizeof(uint32_t);
}

ovoid_status ov_record_read(ovoid_context *context, const ov_record *record, ov_reading *from,
                            ov_part_fit *fit) {
    ovoid_status status = OVOID_OK;
    ov_found found = {.count = (size_t)record->ellipsoids};
    OV_TRY(ov_bytes_take_array(context, from, &found.quadrics, record->ellipsoids,
                               sizeof *found.quadrics, "ellipsoids"));
    OV_TRY(ov_bytes_take_array(context, from, &found.owner, owners_of(record), sizeof *found.owner,
                               "owners"));
    if (hash_of(record, &found) != record->hash)
        OV_TRY(ov_fail(context, OVOID_ERROR_FORMAT, "what is on record of a part is spoilt"));
    fit->found = found;
    found = (ov_found){0};
    tell(record, &fit->result);
cleanup:
    ov_found_destroy(&found);
    return status;
}

ovoid_status ov_record_take(ovoid_context *context, size_t part, size_t atoms, ov_reading *from,
                            ov_part_fit *fit) {
    ov_record record;
    if (!ov_bytes_take(from, &record, sizeof record) || !ov_record_is_sound(&record) ||
        record.part != part || record.atoms != atoms)
        return ov_fail(context, OVOID_ERROR_FORMAT, "what is on record of a part is of another");
    return ov_record_read(context, &record, from, fit);
}
