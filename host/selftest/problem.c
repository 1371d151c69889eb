#include "selftest/problem.h"

#include "selftest/check.h"

#include <stdlib.h>

ovoid_status ov_problem_upload(ovoid_context *context, ov_problem *p) {
    const size_t places = p->points->packs * OV_PACK;
    const ovoid_status status = ov_put_floats(context, &p->weights, p->weight, places);
    return status != OVOID_OK ? status : ov_put_floats(context, &p->residuals, p->u, places);
}

ovoid_status ov_problem_solve(ovoid_context *context, ov_problem *p, ov_solver *solver,
                              double lambda, uint32_t iterations, double tolerance, double *step) {
    ovoid_status status = OVOID_OK;
    const ov_system system = {.points = p->points,
                              .terms = p->terms,
                              .lists = p->lists,
                              .weight = &p->weights,
                              .moments = &p->moments,
                              .gram = &p->gram,
                              .parameters = p->x,
                              .count = p->count,
                              .followers = &p->followers};
    OV_TRY(ov_moments(context, p->operations, p->points, p->terms, p->lists, &p->residuals,
                      &p->moments));
    OV_TRY(ov_followers_fold(context, &p->followers, p->count, NULL, &p->moments));
    OV_TRY(ov_gram(context, p->operations, p->points, p->terms, p->lists, &p->weights, &p->gram));
    OV_TRY(ov_solve(context, solver, p->operations, &system, lambda, iterations, tolerance, step));
cleanup:
    return status;
}

void ov_problem_destroy(ov_problem *p) {
    ov_buffer *const buffers[] = {&p->weights, &p->residuals, &p->moments, &p->gram};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_followers_destroy(&p->followers);
    free(p->x);
    free(p->weight);
    free(p->u);
    *p = (ov_problem){NULL};
}
