/*
 * How long the rest of a fit in parts takes, by those that are done.
 */
#ifndef CLI_FORECAST_H
#define CLI_FORECAST_H

#include "ovoid/ovoid.h"

/* {0}: nothing is known yet. */
typedef struct cli_forecast {
    uint64_t total, first; /* parts, and those that were done when it began */
    uint64_t done;         /* when that last changed */
    double began, changed; /* seconds, by the clock of the progress */
    bool over;             /* the parts are done, and what follows are not such parts */
} cli_forecast;

/* Takes note of what is going on, `at_once` parts at a time; seconds that the rest of the parts
 * takes from now on, 0 where that cannot be known, as before so many parts are done. */
double cli_forecast_left(cli_forecast *forecast, const ovoid_progress *progress, uint64_t at_once);

#endif
