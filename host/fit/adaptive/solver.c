#include "fit/adaptive/solver.h"

#include <stdlib.h>
#include <string.h>

/* Iterations between looks at the residual: each look waits for the device. */
#define LOOK_EVERY 4

/* Work-groups, each of which leaves a sum. */
static size_t groups_of(const ov_solver *s, size_t count) {
    return (count + s->group - 1) / s->group;
}

static ovoid_status prepare(ovoid_context *context, ov_solver *s, size_t count) {
    ovoid_status status = OVOID_OK;
    const size_t vector = count * OV_FACTOR_PARAMETERS * sizeof(cl_float);
    size_t groups;
    ov_device *device;
    ov_buffer *const vectors[] = {&s->diagonal, &s->x, &s->r, &s->z, &s->p, &s->q, &s->polynomial};
    ov_buffer *const sums[] = {&s->rz, &s->rz_next, &s->pq};
    OV_TRY(ov_device_get(context, &device));
    s->group = device->solve_group;
    groups = groups_of(s, count);
    if (!s->start.handle) {
        OV_TRY(ov_kernel_create(context, "solve", "solve_product", &s->product));
        OV_TRY(ov_kernel_create(context, "solve", "solve_update", &s->update));
        OV_TRY(ov_kernel_create(context, "solve", "solve_direction", &s->direction));
        OV_TRY(ov_kernel_create(context, "solve", "solve_start", &s->start));
    }
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; ++k)
        OV_TRY(ov_buffer_reserve(context, vectors[k], vector, "vectors of the solver"));
    for (size_t k = 0; k < sizeof sums / sizeof *sums; ++k)
        OV_TRY(ov_buffer_reserve(context, sums[k], groups * sizeof(cl_float), "sums"));
    OV_TRY(ov_buffer_reserve(context, &s->factor, count * OV_SOLVE_FACTOR * sizeof(cl_float),
                             "factors"));
    OV_TRY(
        ov_buffer_reserve(context, &s->block, count * OV_SOLVE_BLOCK * sizeof(cl_float), "blocks"));
    OV_TRY(ov_grow(context, &s->host, &s->host_capacity, count * OV_FACTOR_PARAMETERS,
                   sizeof *s->host, "steps"));
cleanup:
    return status;
}

static ovoid_status upload_factors(ovoid_context *context, ov_solver *s, const double *parameters,
                                   size_t count) {
    for (size_t i = 0; i < count; ++i)
        for (size_t k = 0; k < OV_SOLVE_FACTOR; ++k)
            s->host[OV_SOLVE_FACTOR * i + k] =
                (float)parameters[i * OV_FACTOR_PARAMETERS + OV_FACTOR_L + k];
    return ov_buffer_write(context, &s->factor, 0, s->host,
                           OV_SOLVE_FACTOR * count * sizeof *s->host);
}

static ovoid_status read_sum(ovoid_context *context, ov_solver *s, const ov_buffer *partial,
                             size_t groups, double *sum) {
    const ovoid_status status =
        ov_buffer_read(context, partial, 0, s->host, groups * sizeof *s->host);
    *sum = 0.0;
    for (size_t k = 0; status == OVOID_OK && k < groups; ++k)
        *sum += s->host[k];
    return status;
}

/* q = (J^T W J + lambda D) p */
static ovoid_status multiply(ovoid_context *context, ov_solver *s, ov_operations *operations,
                             const ov_system *system, cl_float lambda) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)system->terms->count;
    OV_TRY(ov_field_polynomial(context, operations, system->points, system->terms, system->lists,
                               &s->polynomial, system->weight, &s->jacobian_p));
    OV_TRY(ov_moments(context, operations, system->points, system->terms, system->lists,
                      &s->jacobian_p, &s->moments));
    OV_TRY(OV_LAUNCH(context, &s->product, count, s->group, OV_ARG(count), OV_ARG(lambda),
                     OV_ARG(s->factor.memory), OV_ARG(s->moments.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->pq.memory)));
cleanup:
    return status;
}

static ovoid_status iterate(ovoid_context *context, ov_solver *s, ov_operations *operations,
                            const ov_system *system, cl_float lambda, uint32_t iterations,
                            double tolerance) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)system->terms->count;
    const cl_uint groups = (cl_uint)groups_of(s, count);
    double start, now;
    OV_TRY(read_sum(context, s, &s->rz, groups, &start));
    for (uint32_t k = 1; k <= iterations && start > 0.0; ++k) {
        OV_TRY(multiply(context, s, operations, system, lambda));
        OV_TRY(OV_LAUNCH(context, &s->update, count, s->group, OV_ARG(count), OV_ARG(groups),
                         OV_ARG(s->block.memory), OV_ARG(s->rz.memory), OV_ARG(s->pq.memory),
                         OV_ARG(s->p.memory), OV_ARG(s->q.memory), OV_ARG(s->x.memory),
                         OV_ARG(s->r.memory), OV_ARG(s->z.memory), OV_ARG(s->rz_next.memory)));
        ++s->iterations;
        if (k == iterations)
            break;
        if (k % LOOK_EVERY == 0) {
            OV_TRY(read_sum(context, s, &s->rz_next, groups, &now));
            if (!(now > tolerance * tolerance * start))
                break;
        }
        OV_TRY(OV_LAUNCH(context, &s->direction, count, s->group, OV_ARG(count), OV_ARG(groups),
                         OV_ARG(s->factor.memory), OV_ARG(s->rz.memory), OV_ARG(s->rz_next.memory),
                         OV_ARG(s->z.memory), OV_ARG(s->p.memory), OV_ARG(s->polynomial.memory)));
        const ov_buffer swap = s->rz;
        s->rz = s->rz_next;
        s->rz_next = swap;
    }
cleanup:
    return status;
}

ovoid_status ov_solve(ovoid_context *context, ov_solver *s, ov_operations *operations,
                      const ov_system *system, double lambda, uint32_t iterations, double tolerance,
                      double *step) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)system->terms->count;
    const cl_float damping = (cl_float)lambda;
    const size_t size = count * (size_t)OV_FACTOR_PARAMETERS;
    OV_TRY(prepare(context, s, count));
    OV_TRY(upload_factors(context, s, system->parameters, count));
    OV_TRY(OV_LAUNCH(context, &s->start, count, s->group, OV_ARG(count), OV_ARG(damping),
                     OV_ARG(s->factor.memory), OV_ARG(system->gram->memory),
                     OV_ARG(system->moments->memory), OV_ARG(s->block.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->x.memory), OV_ARG(s->r.memory),
                     OV_ARG(s->p.memory), OV_ARG(s->polynomial.memory), OV_ARG(s->rz.memory)));
    OV_TRY(iterate(context, s, operations, system, damping, iterations, tolerance));
    OV_TRY(ov_buffer_read(context, &s->x, 0, s->host, size * sizeof *s->host));
    for (size_t j = 0; j < size; ++j)
        step[j] = s->host[j];
cleanup:
    return status;
}

void ov_solver_destroy(ov_solver *s) {
    ov_kernel *const kernels[] = {&s->start, &s->product, &s->update, &s->direction};
    ov_buffer *const buffers[] = {&s->factor,  &s->block, &s->diagonal,   &s->x,          &s->r,
                                  &s->z,       &s->p,     &s->q,          &s->polynomial, &s->rz,
                                  &s->rz_next, &s->pq,    &s->jacobian_p, &s->moments};
    for (size_t k = 0; k < sizeof kernels / sizeof *kernels; ++k)
        ov_kernel_destroy(kernels[k]);
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    free(s->host);
    memset(s, 0, sizeof *s);
}
