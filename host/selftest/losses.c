#include "selftest/losses.h"

#include "mixture/component.h"
#include "selftest/check.h"

#include <math.h>
#include <stdlib.h>

ovoid_status ov_charges_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                               const ov_points *points, const double *xyz, uint64_t seed,
                               ov_charges *charges) {
    const size_t places = points->packs * OV_PACK;
    float **const arrays[] = {&charges->value, &charges->low, &charges->high, &charges->weight};
    ov_random random = {seed};
    *charges = (ov_charges){NULL};
    for (size_t n = 0; n < sizeof arrays / sizeof *arrays; ++n) {
        *arrays[n] = ov_alloc(context, places, sizeof **arrays[n], "values of a check");
        if (!*arrays[n]) {
            ov_charges_destroy(charges);
            return OVOID_ERROR_MEMORY;
        }
    }
    for (size_t k = 0; k < places; ++k) {
        if (ov_points_fill(points, k))
            continue;
        const double phi = ov_twin_field(quadrics, count, xyz + 3 * k).value;
        const float bound = (float)(phi * ov_random_uniform(&random, 0.7, 1.3));
        charges->value[k] = (float)phi;
        charges->low[k] = k % 3 == 1 ? -FLT_MAX : bound;
        charges->high[k] = k % 3 == 0 ? FLT_MAX : bound;
        charges->weight[k] = (float)ov_random_uniform(&random, 0.0, 2.0);
    }
    return OVOID_OK;
}

void ov_charges_destroy(ov_charges *charges) {
    free(charges->value);
    free(charges->low);
    free(charges->high);
    free(charges->weight);
    *charges = (ov_charges){NULL};
}

double ov_twin_square_residual(double value, double low, double high) {
    const double r = value - fmin(fmax(value, low), high);
    return r * r;
}

ov_twin_sum ov_twin_loss(const ov_quadric *quadrics, const uint32_t pair[2],
                         const ov_quadric *merged, const double *xyz, size_t places,
                         const ov_charges *charges, const bool *counted) {
    ov_twin_sum sum = {0};
    for (size_t k = 0; k < places; ++k) {
        if (charges->weight[k] == 0.0f || (counted && !counted[k / OV_PACK]))
            continue;
        const double *const y = xyz + 3 * k;
        const double low = charges->low[k], high = charges->high[k], weight = charges->weight[k];
        const ov_twin_sum ei = ov_twin_field(&quadrics[pair[0]], 1, y),
                          ej = ov_twin_field(&quadrics[pair[1]], 1, y),
                          em = ov_twin_field(merged, 1, y);
        const double before = charges->value[k], after = before - ei.value - ej.value + em.value;
        const double x = ov_twin_square_residual(after, low, high),
                     z = ov_twin_square_residual(before, low, high);
        sum.value += weight * (x - z);
        sum.scale +=
            weight *
            (x + z + 2.0 * sqrt(x) * (ei.scale + ej.scale + em.scale + 2.0 * fabs(before)));
    }
    return sum;
}

ovoid_status ov_merge_quadrics(ovoid_context *context, const ov_quadric *a, const ov_quadric *b,
                               ov_quadric *merged) {
    ov_component p, q, both;
    if (!ov_component_of_quadric(a, &p) || !ov_component_of_quadric(b, &q))
        return ov_fail(context, OVOID_ERROR_NUMERIC, "a term of a check is no Gaussian");
    ov_component_merge(&p, &q, &both);
    ov_quadric_of_component(&both, merged);
    return OVOID_OK;
}

ovoid_status ov_losses(ovoid_context *context, const ov_points *points, const ov_terms *terms,
                       const ov_lists *lists, const ov_charges *charges, const uint32_t *pairs,
                       const ov_quadric *merged, size_t count, float **losses) {
    ovoid_status status = OVOID_OK;
    const double origin[3] = {0};
    const float *const given[] = {charges->value, charges->low, charges->high, charges->weight};
    const cl_uint pairs_count = (cl_uint)count;
    ov_kernel kernel = {0};
    ov_terms with = {0};
    ov_buffer in[4] = {0}, list = {0}, loss = {0};
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "merge", "merge_loss", &kernel));
    OV_TRY(ov_terms_set(context, &with, merged, count, origin, 1e-37));
    for (size_t k = 0; k < 4; ++k)
        OV_TRY(ov_put_floats(context, &in[k], given[k], points->packs * OV_PACK));
    OV_TRY(ov_buffer_put(context, &list, pairs, 2 * count * sizeof *pairs, "pairs"));
    OV_TRY(ov_buffer_reserve(context, &loss, count * sizeof(float), "losses"));
    OV_TRY(OV_LAUNCH(
        context, &kernel, count * device->shape.lanes, device->team, OV_ARG(pairs_count),
        OV_ARG(list.memory), OV_ARG(with.device.memory), OV_ARG(points->xyz.memory),
        OV_ARG(points->pack_origins.memory), OV_ARG(in[0].memory), OV_ARG(in[1].memory),
        OV_ARG(in[2].memory), OV_ARG(in[3].memory), OV_ARG(lists->term_start.memory),
        OV_ARG(lists->term_item.memory), OV_ARG(terms->device.memory), OV_ARG(loss.memory)));
    OV_TRY(ov_read_words(context, &loss, count, losses));
cleanup:
    for (size_t k = 0; k < 4; ++k)
        ov_buffer_destroy(&in[k]);
    ov_buffer_destroy(&list);
    ov_buffer_destroy(&loss);
    ov_terms_destroy(&with);
    ov_kernel_destroy(&kernel);
    return status;
}
