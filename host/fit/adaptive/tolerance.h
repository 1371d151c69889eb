/*
 * The search for the fewest ellipsoids within a tolerance: growing where the model is off,
 * shrinking where there is room, both place by place.
 */
#ifndef OV_ADAPTIVE_TOLERANCE_H
#define OV_ADAPTIVE_TOLERANCE_H

#include "fit/adaptive/places.h"
#include "fit/adaptive/search.h"

/* How long growing may go on. */
typedef struct ov_growing {
    const char *stage;
    size_t most; /* ellipsoids */
    uint32_t rounds;
    uint32_t patience; /* a place is only refined, with more weight, when it is met so many times;
                          as many as rounds: ellipsoids keep their places in the model, too */
} ov_growing;

/* Whether the tolerance was seen to hold when the trial was judged last. */
bool ov_trial_holds(const ov_trial *t, double tolerance);

/* Judges a trial and finds the spots that are off, `most` at most; none where the tolerance holds.
 */
ovoid_status ov_adaptive_spots(ov_adaptive *f, ov_trial *t, double tolerance, size_t most,
                               ov_spots *spots);

/* What a finished model is held to: the search is for less than what is asked, and half of that is
 * for making volumes equal. */
double ov_adaptive_held_to(const ov_adaptive *f);

/* Whether trials are judged at the finer spacing, too, as far as there is one, and inside the
 * triangles of both, those of parts aside. */
void ov_adaptive_look_closely(ov_adaptive *f, bool closely);

/* Makes the points within `reach` (angstrom) of the spots weigh `factor` times as much from now on.
 */
ovoid_status ov_adaptive_emphasise(ov_adaptive *f, const ov_spots *spots, double reach,
                                   double factor);

/* Adds ellipsoids at the spots, as of ov_adaptive_spots(), and where the model is off after that,
 * until the tolerance holds: *spots are none then. */
ovoid_status ov_adaptive_grow(ov_adaptive *f, double tolerance, const ov_growing *how, ov_trial *t,
                              ov_spots *spots);

/* When shrinking ends: at so many ellipsoids, or when so many rounds and tries in a row gained less
 * than a share of them together; thorough: of rounds that merged few at once. */
typedef struct ov_shrinking {
    const char *stage;
    size_t least;
    double gain;
    uint32_t idle_rounds, idle_tries;
    bool thorough;
} ov_shrinking;

/* Merges ellipsoids of the best model, which holds, as long as it holds. */
ovoid_status ov_adaptive_shrink(ov_adaptive *f, double tolerance, const ov_shrinking *how,
                                ov_trial *best);

#endif
