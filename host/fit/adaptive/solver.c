#include "fit/adaptive/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
    s->wide = device->shape.lanes == 1 ? s->group : OV_SOLVE_WIDE;
    if (s->looks == OV_LOOKS_OF_DEVICE)
        s->looks = device->shape.lanes == 1 ? OV_LOOKS_WAIT : OV_LOOKS_LAG;
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

/* ---- looks at the residual ------------------------------------------------------------------ */

/* The residual is looked at after each fourth iteration. CPUs wait for it, which takes less than an
 * iteration. To others it is a round trip: it is read while the next iteration runs, which then
 * leaves x alone if it was not to be done any more. */
#define LOOK_EVERY 4

typedef struct look {
    ov_later later;
    float *partial; /* room for the sums of all groups */
    size_t groups;
} look;

static ovoid_status begin_look(ovoid_context *context, const ov_buffer *sums, size_t groups,
                               look *l) {
    l->groups = groups;
    return ov_buffer_read_later(context, sums, 0, l->partial, groups * sizeof *l->partial,
                                &l->later);
}

static double sum_of(const look *l) {
    double sum = 0.0;
    for (size_t k = 0; k < l->groups; ++k)
        sum += l->partial[k];
    return sum;
}

/* The sum stays where no look was begun. */
static ovoid_status end_look(ovoid_context *context, look *l, double *sum) {
    if (!l->later.event)
        return OVOID_OK;
    const ovoid_status status = ov_later_end(context, &l->later);
    if (status == OVOID_OK)
        *sum = sum_of(l);
    return status;
}

/* Waits for the sum. */
static ovoid_status look_now(ovoid_context *context, const ov_buffer *sums, size_t groups, look *l,
                             double *sum) {
    l->groups = groups;
    const ovoid_status status =
        ov_buffer_read(context, sums, 0, l->partial, groups * sizeof *l->partial);
    if (status == OVOID_OK)
        *sum = sum_of(l);
    return status;
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
    cl_float least;        /* residual to be reached, for iterations that may be too many; or 0 */
} work;

/* The moments of J^T W J p. */
static ovoid_status multiply(const work *w) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    const ov_system *const system = w->system;
    OV_TRY(ov_field_polynomial(w->context, w->operations, system->points, system->terms,
                               system->lists, &s->polynomial, system->weight, &s->jacobian_p));
    OV_TRY(ov_moments(w->context, w->operations, system->points, system->terms, system->lists,
                      &s->jacobian_p, &s->moments));
cleanup:
    return status;
}

/* The rest of an iteration by one work-group, which leaves one sum. */
static ovoid_status step_alone(work *w) {
    ov_solver *const s = w->s;
    const cl_uint groups = w->groups;
    w->groups = 1;
    return OV_LAUNCH(w->context, &s->step, s->wide, s->wide, OV_ARG(w->count), OV_ARG(w->lambda),
                     OV_ARG(groups), OV_ARG(w->least), OV_ARG(s->factor.memory),
                     OV_ARG(s->moments.memory), OV_ARG(s->diagonal.memory), OV_ARG(s->block.memory),
                     OV_ARG(s->rz.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->x.memory), OV_ARG(s->r.memory), OV_ARG(s->z.memory),
                     OV_ARG(s->polynomial.memory), OV_ARG(s->rz_next.memory));
}

/* The same by many. */
static ovoid_status step_together(const work *w) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = w->context;
    ov_solver *const s = w->s;
    OV_TRY(OV_LAUNCH(context, &s->product, w->count, s->group, OV_ARG(w->count), OV_ARG(w->lambda),
                     OV_ARG(s->factor.memory), OV_ARG(s->moments.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->pq.memory)));
    OV_TRY(OV_LAUNCH(context, &s->update, w->count, s->group, OV_ARG(w->count), OV_ARG(w->groups),
                     OV_ARG(w->least), OV_ARG(s->block.memory), OV_ARG(s->rz.memory),
                     OV_ARG(s->pq.memory), OV_ARG(s->p.memory), OV_ARG(s->q.memory),
                     OV_ARG(s->x.memory), OV_ARG(s->r.memory), OV_ARG(s->z.memory),
                     OV_ARG(s->rz_next.memory)));
    OV_TRY(OV_LAUNCH(context, &s->direction, w->count, s->group, OV_ARG(w->count),
                     OV_ARG(w->groups), OV_ARG(s->factor.memory), OV_ARG(s->rz.memory),
                     OV_ARG(s->rz_next.memory), OV_ARG(s->z.memory), OV_ARG(s->p.memory),
                     OV_ARG(s->polynomial.memory)));
cleanup:
    return status;
}

static ovoid_status iteration(work *w) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    OV_TRY(multiply(w));
    OV_TRY(w->count <= OV_SOLVE_ALONE && !s->apart ? step_alone(w) : step_together(w));
    const ov_buffer swap = s->rz;
    s->rz = s->rz_next;
    s->rz_next = swap;
cleanup:
    return status;
}

/* What looks are under way write to s->host: they end before others do. */
static ovoid_status end_both(ovoid_context *context, look *first, look *later,
                             ovoid_status status) {
    const ovoid_status one = ov_later_end(context, &first->later);
    const ovoid_status other = ov_later_end(context, &later->later);
    return status != OVOID_OK ? status : one != OVOID_OK ? one : other;
}

/* *still: there is nothing to solve, and x is no solution. */
static ovoid_status iterate(work *w, uint32_t iterations, double tolerance, bool *still) {
    ovoid_status status = OVOID_OK;
    ov_solver *const s = w->s;
    double start = 0.0, now = INFINITY;
    cl_float least = 0.0f;
    look first = {.partial = s->host}, later = {.partial = s->host + groups_of(s, w->count)};
    *still = false;
    if (iterations > 0)
        OV_TRY(begin_look(w->context, &s->rz, w->groups, &first));
    for (uint32_t k = 1; k <= iterations && now > (double)least; ++k) {
        w->least = later.later.event ? least : 0.0f;
        OV_TRY(iteration(w));
        OV_TRY(end_look(w->context, &first, &start));
        least = (cl_float)(tolerance * tolerance * start);
        *still = !(start > 0.0);
        OV_TRY(end_look(w->context, &later, &now));
        if (*still || !(now > (double)least))
            break;
        ++s->iterations;
        if (k % LOOK_EVERY == 0 && k < iterations)
            OV_TRY(s->looks == OV_LOOKS_WAIT ? look_now(w->context, &s->rz, w->groups, &later, &now)
                                             : begin_look(w->context, &s->rz, w->groups, &later));
    }
cleanup:
    return end_both(w->context, &first, &later, status);
}

ovoid_status ov_solve(ovoid_context *context, ov_solver *s, ov_operations *operations,
                      const ov_system *system, double lambda, uint32_t iterations, double tolerance,
                      double *step) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)system->terms->count;
    const cl_float damping = (cl_float)lambda;
    const size_t size = count * (size_t)OV_FACTOR_PARAMETERS;
    bool still;
    OV_TRY(prepare(context, s, count));
    work w = {context, s, operations, system, damping, count, (cl_uint)groups_of(s, count), 0.0f};
    OV_TRY(upload_factors(context, s, system->parameters, count));
    OV_TRY(OV_LAUNCH(context, &s->start, count, s->group, OV_ARG(count), OV_ARG(damping),
                     OV_ARG(s->factor.memory), OV_ARG(system->gram->memory),
                     OV_ARG(system->moments->memory), OV_ARG(s->block.memory),
                     OV_ARG(s->diagonal.memory), OV_ARG(s->x.memory), OV_ARG(s->r.memory),
                     OV_ARG(s->p.memory), OV_ARG(s->polynomial.memory), OV_ARG(s->rz.memory)));
    OV_TRY(iterate(&w, iterations, tolerance, &still));
    memset(step, 0, size * sizeof *step);
    if (still)
        goto cleanup;
    OV_TRY(ov_buffer_read(context, &s->x, 0, s->host, size * sizeof *s->host));
    for (size_t j = 0; j < size; ++j)
        step[j] = s->host[j];
cleanup:
    return status;
}

void ov_solver_destroy(ov_solver *s) {
    ov_kernel *const kernels[] = {&s->start, &s->product, &s->update, &s->direction, &s->step};
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
