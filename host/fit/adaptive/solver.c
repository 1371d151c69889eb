#include "fit/adaptive/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Work-groups, each of which leaves a sum. */
static size_t groups_of(const ov_solver *s, size_t count) {
    return (count + s->group - 1) / s->group;
}

/* all: with the images. */
static ovoid_status prepare(ovoid_context *context, ov_solver *s, size_t count, size_t all) {
    ovoid_status status = OVOID_OK;
    const size_t vector = count * OV_FACTOR_PARAMETERS * sizeof(cl_float);
    size_t groups;
    ov_device *device;
    ov_buffer *const vectors[] = {&s->diagonal, &s->x, &s->r, &s->z, &s->p, &s->q};
    ov_buffer *const sums[] = {&s->rz, &s->rz_next, &s->pq};
    OV_TRY(ov_device_get(context, &device));
    s->group = device->solve_group;
    s->wide = device->shape.lanes == 1 ? s->group : OV_SOLVE_WIDE;
    groups = groups_of(s, count);
    if (!s->start.handle) {
        OV_TRY(ov_kernel_create(context, "solve", "solve_product", &s->product));
        OV_TRY(ov_kernel_create(context, "solve", "solve_update", &s->update));
        OV_TRY(ov_kernel_create(context, "solve", "solve_direction", &s->direction));
        OV_TRY(ov_kernel_create(context, "solve", "solve_step", &s->step));
        OV_TRY(ov_kernel_create(context, "solve", "solve_start", &s->start));
    }
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; ++k)
        OV_TRY(ov_buffer_reserve(context, vectors[k], vector, "vectors of the solver"));
    OV_TRY(ov_buffer_reserve(context, &s->polynomial, all * OV_MONOMIALS * sizeof(cl_float),
                             "polynomials"));
    for (size_t k = 0; k < sizeof sums / sizeof *sums; ++k)
        OV_TRY(ov_buffer_reserve(context, sums[k], groups * sizeof(cl_float), "sums"));
    OV_TRY(ov_buffer_reserve(context, &s->limit, sizeof(cl_float), "limits"));
    OV_TRY(ov_buffer_reserve(context, &s->state, 2 * sizeof(cl_uint), "states"));
    OV_TRY(ov_buffer_reserve(context, &s->state_next, 2 * sizeof(cl_uint), "states"));
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

/* ---- iterations ------------------------------------------------------------------------------ */

/* What an iteration works on. */
typedef struct work {
    ovoid_context *context;
    ov_solver *s;
    ov_operations *operations;
    const ov_system *system;
    cl_float lambda;
    cl_uint count, groups; /* ellipsoids; partial sums in s->rz */
    cl_float share;        /* of the residual, squared, that is to be left */
} work;

/* The moments of J^T W J p. */
static ovoid_status multiply(const work *w) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    const ov_system *const system = w->system;
    w->operations->idle = &s->state;
    OV_TRY(ov_followers_turn(w->context, system->followers, w->count, &s->state, &s->polynomial));
    OV_TRY(ov_field_polynomial(w->context, w->operations, system->points, system->terms,
                               system->lists, &s->polynomial, system->weight, &s->jacobian_p));
    OV_TRY(ov_moments(w->context, w->operations, system->points, system->terms, system->lists,
                      &s->jacobian_p, &s->moments));
    OV_TRY(ov_followers_fold(w->context, system->followers, w->count, &s->state, &s->moments));
cleanup:
    w->operations->idle = NULL;
    return status;
}

/* The rest of an iteration by one work-group, which leaves one sum. */
static ovoid_status step_alone(work *w) {
    ov_solver *const s = w->s;
    const cl_uint groups = w->groups;
    w->groups = 1;
    return OV_LAUNCH(w->context, &s->step, s->wide, s->wide, OV_ARG(w->count), OV_ARG(w->lambda),
                     OV_ARG(groups), OV_ARG(w->share), OV_ARG(s->state.memory),
                     OV_ARG(s->factor.memory), OV_ARG(s->moments.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->block.memory), OV_ARG(s->rz.memory),
                     OV_ARG(s->p.memory), OV_ARG(s->q.memory), OV_ARG(s->x.memory),
                     OV_ARG(s->r.memory), OV_ARG(s->z.memory), OV_ARG(s->polynomial.memory),
                     OV_ARG(s->rz_next.memory), OV_ARG(s->limit.memory),
                     OV_ARG(s->state_next.memory), OV_LOCAL(s->wide * sizeof(cl_float)));
}

/* The same by many. */
static ovoid_status step_together(const work *w) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = w->context;
    ov_solver *const s = w->s;
    OV_TRY(OV_LAUNCH(context, &s->product, w->count, s->group, OV_ARG(w->count), OV_ARG(w->lambda),
                     OV_ARG(s->state.memory), OV_ARG(s->factor.memory), OV_ARG(s->moments.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->pq.memory)));
    OV_TRY(OV_LAUNCH(context, &s->update, w->count, s->group, OV_ARG(w->count), OV_ARG(w->groups),
                     OV_ARG(s->state.memory), OV_ARG(s->block.memory), OV_ARG(s->rz.memory),
                     OV_ARG(s->pq.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->x.memory), OV_ARG(s->r.memory), OV_ARG(s->z.memory),
                     OV_ARG(s->rz_next.memory)));
    OV_TRY(OV_LAUNCH(context, &s->direction, w->count, s->group, OV_ARG(w->count),
                     OV_ARG(w->groups), OV_ARG(w->share), OV_ARG(s->state.memory),
                     OV_ARG(s->factor.memory), OV_ARG(s->rz.memory), OV_ARG(s->rz_next.memory),
                     OV_ARG(s->z.memory), OV_ARG(s->p.memory), OV_ARG(s->polynomial.memory),
                     OV_ARG(s->limit.memory), OV_ARG(s->state_next.memory)));
cleanup:
    return status;
}

static void swap_buffers(ov_buffer *a, ov_buffer *b) {
    const ov_buffer swap = *a;
    *a = *b;
    *b = swap;
}

static ovoid_status iteration(work *w) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    OV_TRY(multiply(w));
    OV_TRY(w->count <= OV_SOLVE_ALONE && !s->apart ? step_alone(w) : step_together(w));
    swap_buffers(&s->rz, &s->rz_next);
    swap_buffers(&s->state, &s->state_next);
cleanup:
    return status;
}

/* The step so far with the state, in one round trip. */
static ovoid_status read_step(work *w, cl_uint state[2]) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    const size_t size = w->count * (size_t)OV_FACTOR_PARAMETERS;
    ov_later later = {0};
    OV_TRY(ov_buffer_read_later(w->context, &s->state, 0, state, 2 * sizeof *state, &later));
    OV_TRY(ov_buffer_read(w->context, &s->x, 0, s->host, size * sizeof *s->host));
cleanup:;
    const ovoid_status other = ov_later_end(w->context, &later);
    return status != OVOID_OK ? status : other;
}

/* Iterations are started without waiting: at first as many as the last solution took, as those
 * of the steps of one fit are much alike, and where that was not enough a few more at a time. One
 * too many costs three launches of kernels that return at once. */
#define MORE 2

static ovoid_status iterate(work *w, uint32_t iterations) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    cl_uint state[2] = {0, 0};
    uint32_t next = s->last > 0 ? s->last : 2 * MORE;
    for (uint32_t begun = 0; begun == 0 || (begun < iterations && state[0] == 0); next = MORE) {
        for (; next > 0 && begun < iterations; --next, ++begun)
            OV_TRY(iteration(w));
        OV_TRY(read_step(w, state));
        if (iterations == 0)
            break;
    }
    s->last = state[1];
    s->iterations += state[1];
cleanup:
    return status;
}

ovoid_status ov_solve(ovoid_context *context, ov_solver *s, ov_operations *operations,
                      const ov_system *system, double lambda, uint32_t iterations, double tolerance,
                      double *step) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)system->count;
    const cl_float damping = (cl_float)lambda;
    const size_t size = count * (size_t)OV_FACTOR_PARAMETERS;
    OV_TRY(prepare(context, s, count, system->terms->count));
    work w = {context,
              s,
              operations,
              system,
              damping,
              count,
              (cl_uint)groups_of(s, count),
              (cl_float)(tolerance * tolerance)};
    OV_TRY(upload_factors(context, s, system->parameters, count));
    OV_TRY(OV_LAUNCH(context, &s->start, count, s->group, OV_ARG(count), OV_ARG(damping),
                     OV_ARG(s->factor.memory), OV_ARG(system->gram->memory),
                     OV_ARG(system->moments->memory), OV_ARG(s->block.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->x.memory), OV_ARG(s->r.memory),
                     OV_ARG(s->p.memory), OV_ARG(s->polynomial.memory), OV_ARG(s->rz.memory),
                     OV_ARG(s->state.memory)));
    OV_TRY(iterate(&w, iterations));
    for (size_t j = 0; j < size; ++j)
        step[j] = s->host[j];
cleanup:
    return status;
}

void ov_solver_destroy(ov_solver *s) {
    ov_kernel *const kernels[] = {&s->start, &s->product, &s->update, &s->direction, &s->step};
    ov_buffer *const buffers[] = {
        &s->factor,     &s->block,   &s->diagonal,   &s->x,     &s->r,         &s->z,
        &s->p,          &s->q,       &s->polynomial, &s->rz,    &s->rz_next,   &s->pq,
        &s->jacobian_p, &s->moments, &s->limit,      &s->state, &s->state_next};
    for (size_t k = 0; k < sizeof kernels / sizeof *kernels; ++k)
        ov_kernel_destroy(kernels[k]);
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    free(s->host);
    memset(s, 0, sizeof *s);
}
