#include "selftest/costs.h"

#include "selftest/check.h"

#include <math.h>
#include <stdlib.h>

#define LAUNCHES 500
#define TRIES 5
#define BLOCK ((size_t)16 << 20) /* bytes of a transfer */

static ovoid_status launch(ovoid_context *context, const ov_kernel *kernel,
                           const ov_buffer *buffer) {
    return OV_LAUNCH(context, kernel, 1, 0, OV_ARG(buffer->memory));
}

/* Seconds of each of many launches in a row, the last one waited for. */
static ovoid_status time_launches(ovoid_context *context, const ov_kernel *kernel,
                                  const ov_buffer *buffer, double *seconds) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_finish(context));
    const double began = ov_seconds();
    for (int n = 0; n < LAUNCHES; ++n)
        OV_TRY(launch(context, kernel, buffer));
    OV_TRY(ov_finish(context));
    *seconds = fmin(*seconds, (ov_seconds() - began) / LAUNCHES);
cleanup:
    return status;
}

static ovoid_status time_round_trip(ovoid_context *context, const ov_kernel *kernel,
                                    const ov_buffer *buffer, double *seconds) {
    ovoid_status status = OVOID_OK;
    uint32_t word;
    const double began = ov_seconds();
    OV_TRY(launch(context, kernel, buffer));
    OV_TRY(ov_buffer_read(context, buffer, 0, &word, sizeof word));
    *seconds = fmin(*seconds, ov_seconds() - began);
cleanup:
    return status;
}

static ovoid_status time_transfers(ovoid_context *context, ov_buffer *block, void *host, double *to,
                                   double *from) {
    ovoid_status status = OVOID_OK;
    double began = ov_seconds();
    OV_TRY(ov_buffer_write(context, block, 0, host, BLOCK));
    OV_TRY(ov_finish(context));
    *to = fmax(*to, (double)BLOCK / (ov_seconds() - began));
    began = ov_seconds();
    OV_TRY(ov_buffer_read(context, block, 0, host, BLOCK));
    *from = fmax(*from, (double)BLOCK / (ov_seconds() - began));
cleanup:
    return status;
}

ovoid_status ov_costs_measure(ovoid_context *context, ov_costs *costs) {
    ovoid_status status = OVOID_OK;
    ov_costs best = {INFINITY, INFINITY, 0.0, 0.0};
    ov_kernel kernel = {0};
    ov_buffer buffer = {0}, block = {0};
    void *const host = ov_alloc(context, BLOCK, 1, "a transfer");
    if (!host)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_kernel_create(context, "layout", "layout", &kernel));
    OV_TRY(ov_buffer_reserve(context, &buffer, OV_LAYOUT_MOST * sizeof(uint32_t), "a layout"));
    OV_TRY(ov_buffer_reserve(context, &block, BLOCK, "a transfer"));
    for (int n = 0; n < TRIES; ++n) {
        OV_TRY(time_launches(context, &kernel, &buffer, &best.launch));
        for (int k = 0; k < 10; ++k)
            OV_TRY(time_round_trip(context, &kernel, &buffer, &best.round_trip));
        OV_TRY(time_transfers(context, &block, host, &best.to_device, &best.from_device));
    }
    *costs = best;
cleanup:
    free(host);
    ov_buffer_destroy(&buffer);
    ov_buffer_destroy(&block);
    ov_kernel_destroy(&kernel);
    return status;
}
