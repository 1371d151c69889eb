#include "base/box.h"

#include <math.h>

const ov_box ov_box_empty = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

void ov_box_add(ov_box *box, const double at[3], double about) {
    for (size_t k = 0; k < 3; ++k) {
        box->low[k] = fmin(box->low[k], at[k] - about);
        box->high[k] = fmax(box->high[k], at[k] + about);
    }
}

bool ov_boxes_near(const ov_box *a, const ov_box *b, double distance) {
    for (size_t k = 0; k < 3; ++k)
        if (a->low[k] - distance > b->high[k] || b->low[k] - distance > a->high[k])
            return false;
    return true;
}

bool ov_box_near(const ov_box *box, const double at[3], double distance) {
    for (size_t k = 0; k < 3; ++k)
        if (at[k] < box->low[k] - distance || at[k] > box->high[k] + distance)
            return false;
    return true;
}

double ov_box_distance(const ov_box *box, const double at[3]) {
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
        const double off = fmax(fmax(box->low[k] - at[k], at[k] - box->high[k]), 0.0);
        square += off * off;
    }
    return sqrt(square);
}

ov_box ov_box_common(const ov_box *a, const ov_box *b) {
    ov_box common;
    for (size_t k = 0; k < 3; ++k) {
        common.low[k] = fmax(a->low[k], b->low[k]);
        common.high[k] = fmin(a->high[k], b->high[k]);
    }
    return common;
}

ov_box ov_box_larger(const ov_box *box, double by) {
    ov_box larger;
    for (size_t k = 0; k < 3; ++k) {
        larger.low[k] = box->low[k] - by;
        larger.high[k] = box->high[k] + by;
    }
    return larger;
}

ov_box ov_box_move(const ov_box *box, const ov_rigid *rigid) {
    double middle[3], half[3], moved[3];
    ov_box made;
    for (size_t k = 0; k < 3; ++k) {
        middle[k] = 0.5 * box->low[k] + 0.5 * box->high[k];
        half[k] = box->high[k] - middle[k];
    }
    ov_rigid_move(rigid, middle, moved);
    for (size_t k = 0; k < 3; ++k) {
        const double *const row = rigid->rotation + 3 * k;
        const double reach =
            fabs(row[0]) * half[0] + fabs(row[1]) * half[1] + fabs(row[2]) * half[2];
        made.low[k] = moved[k] - reach;
        made.high[k] = moved[k] + reach;
    }
    return made;
}
