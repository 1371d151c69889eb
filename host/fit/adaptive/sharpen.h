/*
 * A model of so many ellipsoids where its surface is furthest off: tolerances that get smaller,
 * each reached with more ellipsoids and then with as many again (see tolerance.h).
 */
#ifndef OV_ADAPTIVE_SHARPEN_H
#define OV_ADAPTIVE_SHARPEN_H

#include "fit/adaptive/search.h"

/* Brings nearer what is furthest off, with as many ellipsoids and the right volume: the best model
 * ends with a score no worse than it had with the right volume. It is judged when this returns, and
 * is at all times one that a stop can hand over. */
ovoid_status ov_adaptive_sharpen(ov_adaptive *f, ov_trial *best);

#endif
