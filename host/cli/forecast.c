#include "forecast.h"

#include <math.h>
#include <string.h>

/* What is not done yet takes some time, seconds. */
#define LEAST 1.0

/* Stages that tell how many parts are done; others count something else. */
static bool is_in_parts(const ovoid_progress *progress) {
    static const char *const stages[] = {"sample", "merge",  "refine", "repair",
                                         "grow",   "shrink", "confirm"};
    if (progress->method != OVOID_METHOD_ADAPTIVE || progress->total == OVOID_UNKNOWN ||
        progress->total < 2)
        return false;
    for (size_t n = 0; n < sizeof stages / sizeof *stages; ++n)
        if (strcmp(progress->stage, stages[n]) == 0)
            return true;
    return false;
}

/* Parts that come from a checkpoint took no time. What follows the parts, patches about seams, is
 * counted anew. */
double cli_forecast_left(cli_forecast *f, const ovoid_progress *progress, uint64_t at_once) {
    if (!is_in_parts(progress) || f->over)
        return 0.0;
    if (f->total == 0) {
        f->total = progress->total;
        f->first = f->done = progress->done;
        f->began = progress->seconds;
    }
    f->over = progress->total != f->total || progress->done < f->first;
    if (f->over || progress->done < f->first + (at_once > 1 ? at_once : 1))
        return 0.0;
    if (progress->done != f->done) {
        f->done = progress->done;
        f->changed = progress->seconds;
    }
    const double each = (f->changed - f->began) / (double)(f->done - f->first);
    const double since = progress->seconds - f->changed; /* at the next one */
    return fmax(each * (double)(f->total - f->done) - since, LEAST);
}
