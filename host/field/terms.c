#include "field/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LOG2_E 1.4426950408889634

ovoid_status ov_atoms_check(ovoid_context *context, const double *xyzr, size_t atoms,
                            double decay) {
    if (!xyzr && atoms)
        return ov_fail(context, OVOID_ERROR_MEMORY,
                       "out of memory for the assembly's %zu atoms (%.1f MB)", atoms,
                       (double)atoms * 4 * sizeof *xyzr / 1e6);
    for (size_t i = 0; i < atoms; ++i) {
        const double radius = xyzr[4 * i + 3];
        if (decay * radius * radius > OV_EXPONENT_MAX)
            return ov_fail(context, OVOID_ERROR_LIMIT,
                           "atom %zu: a radius of %g angstrom is too large for a decay of %g; the "
                           "largest is %.4g angstrom",
                           i + 1, radius, decay, sqrt(OV_EXPONENT_MAX / decay));
    }
    return OVOID_OK;
}

/* Largest amplitude that the kernels' 2^t holds, as a power of two. */
#define LOG2_AMPLITUDE_MAX 127.0

/* Up to rounding: the minors of long needles and pancakes are differences of far larger products.
 */
static bool is_positive_definite(const double a[6]) {
    const double minor = a[0] * a[3] - a[1] * a[1];
    const double determinant = a[0] * (a[3] * a[5] - a[4] * a[4]) -
                               a[1] * (a[1] * a[5] - a[4] * a[2]) +
                               a[2] * (a[1] * a[4] - a[3] * a[2]);
    const double trace = a[0] + a[3] + a[5], rounding = 1e-14 * trace * trace;
    return a[0] > 0.0 && a[3] > 0.0 && a[5] > 0.0 && minor > -rounding &&
           determinant > -rounding * trace;
}

/* q's off-diagonal coefficients are doubled here, once, instead of per pair in the kernels. */
static bool to_term(const ov_quadric *quadric, const double origin[3], double log2_cutoff,
                    ov_term *term) {
    const double log2_amplitude = log2(quadric->amplitude);
    double centre[3];
    float rounded[3];
    for (int k = 0; k < 3; ++k) {
        centre[k] = quadric->centre[k] - origin[k];
        rounded[k] = ov_to_float(centre[k]);
    }
    *term = (ov_term){
        .log2_amplitude = (float)log2_amplitude,
        .x = rounded[0],
        .y = rounded[1],
        .z = rounded[2],
        .rest_x = (float)(centre[0] - (double)rounded[0]),
        .rest_y = (float)(centre[1] - (double)rounded[1]),
        .rest_z = (float)(centre[2] - (double)rounded[2]),
        .xx = (float)(LOG2_E * quadric->a[0]),
        .xy = (float)(2.0 * LOG2_E * quadric->a[1]),
        .xz = (float)(2.0 * LOG2_E * quadric->a[2]),
        .yy = (float)(LOG2_E * quadric->a[3]),
        .yz = (float)(2.0 * LOG2_E * quadric->a[4]),
        .zz = (float)(LOG2_E * quadric->a[5]),
        .reach = (float)(log2_amplitude - log2_cutoff),
    };
    const float sum = term->x + term->y + term->z + term->xx + term->xy + term->xz + term->yy +
                      term->yz + term->zz;
    return isfinite(sum) && isfinite(log2_amplitude) && log2_amplitude <= LOG2_AMPLITUDE_MAX &&
           is_positive_definite(quadric->a);
}

ovoid_status ov_terms_set(ovoid_context *context, ov_terms *terms, const ov_quadric *quadrics,
                          size_t count, const double origin[3], double cutoff) {
    return ov_terms_set_skins(context, terms, quadrics, NULL, count, origin, cutoff);
}

ovoid_status ov_terms_set_skins(ovoid_context *context, ov_terms *terms, const ov_quadric *quadrics,
                                const float *skins, size_t count, const double origin[3],
                                double cutoff) {
    ovoid_status status =
        ov_grow(context, &terms->host, &terms->capacity, count, sizeof *terms->host, "terms");
    if (status != OVOID_OK)
        return status;
    const double log2_cutoff = log2(cutoff);
    for (size_t i = 0; i < count; ++i)
        if (!to_term(&quadrics[i], origin, log2_cutoff, &terms->host[i]))
            return ov_fail(context, OVOID_ERROR_NUMERIC,
                           "ellipsoid %zu is degenerate: amplitude %g, centre (%g, %g, %g), A's "
                           "diagonal (%g, %g, %g)",
                           i + 1, quadrics[i].amplitude, quadrics[i].centre[0],
                           quadrics[i].centre[1], quadrics[i].centre[2], quadrics[i].a[0],
                           quadrics[i].a[3], quadrics[i].a[5]);
    for (size_t i = 0; skins && i < count; ++i)
        terms->host[i].skin = skins[i];
    terms->count = count;
    OV_TRY(
        ov_buffer_put(context, &terms->device, terms->host, count * sizeof *terms->host, "terms"));
cleanup:
    return status;
}

void ov_terms_destroy(ov_terms *terms) {
    free(terms->host);
    ov_buffer_destroy(&terms->device);
    memset(terms, 0, sizeof *terms);
}
