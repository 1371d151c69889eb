#include "base/rigid.h"

#include <math.h>

const ov_rigid ov_rigid_identity = {.rotation = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};

void ov_rigid_turn(const ov_rigid *rigid, const double direction[3], double turned[3]) {
    for (int k = 0; k < 3; ++k) {
        const double *const row = rigid->rotation + 3 * k;
        turned[k] = row[0] * direction[0] + row[1] * direction[1] + row[2] * direction[2];
    }
}

void ov_rigid_move(const ov_rigid *rigid, const double at[3], double moved[3]) {
    ov_rigid_turn(rigid, at, moved);
    for (int k = 0; k < 3; ++k)
        moved[k] += rigid->shift[k];
}

bool ov_is_rotation(const double r[9], double most) {
    double worst = 0.0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            double sum = i == j ? -1.0 : 0.0;
            for (int k = 0; k < 3; ++k)
                sum += r[3 * i + k] * r[3 * j + k];
            worst = fmax(worst, fabs(sum));
        }
    return worst <= most && r[0] * (r[4] * r[8] - r[5] * r[7]) -
                                    r[1] * (r[3] * r[8] - r[5] * r[6]) +
                                    r[2] * (r[3] * r[7] - r[4] * r[6]) >
                                0.0;
}

ov_rigid ov_rigid_inverse(const ov_rigid *rigid) {
    ov_rigid made;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            made.rotation[3 * i + j] = rigid->rotation[3 * j + i];
    ov_rigid_turn(&made, rigid->shift, made.shift);
    for (int k = 0; k < 3; ++k)
        made.shift[k] = -made.shift[k];
    return made;
}

ov_rigid ov_rigid_after(const ov_rigid *first, const ov_rigid *second) {
    ov_rigid made;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            made.rotation[3 * i + j] = 0.0;
            for (int k = 0; k < 3; ++k)
                made.rotation[3 * i + j] +=
                    second->rotation[3 * i + k] * first->rotation[3 * k + j];
        }
    ov_rigid_move(second, first->shift, made.shift);
    return made;
}

void ov_rigid_centre(const ov_rigid *motions, size_t count, double centre[3]) {
    for (size_t k = 0; k < 3; ++k) {
        centre[k] = 0.0;
        for (size_t g = 0; g < count; ++g) /* of the origin they make their shifts */
            centre[k] += motions[g].shift[k] / (double)count;
    }
}

size_t ov_rigid_find(const ov_rigid *motions, size_t count, const ov_rigid *wanted) {
    size_t best = 0;
    double most = -INFINITY;
    for (size_t g = 0; g < count; ++g) {
        double trace = 0.0; /* of the turn from the one to the other */
        for (size_t k = 0; k < 9; ++k)
            trace += motions[g].rotation[k] * wanted->rotation[k];
        if (trace > most) {
            most = trace;
            best = g;
        }
    }
    return best;
}
