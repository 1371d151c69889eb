/*
 * The numbers that steer the adaptive method, ov_tuned.NAME: constants.def has them all.
 */
#ifndef OV_ADAPTIVE_CONSTANTS_H
#define OV_ADAPTIVE_CONSTANTS_H

#include <stdint.h>

typedef struct ov_constants {
#define OV_REAL(name, value) double name;
#define OV_COUNT(name, value) uint32_t name;
#include "fit/adaptive/constants.def"
#undef OV_REAL
#undef OV_COUNT
} ov_constants;

/* A program that defines OV_TUNABLE compiles this room for itself and varies them. */
#ifdef OV_TUNABLE
extern ov_constants ov_tuned;
#else
static const ov_constants ov_tuned = {
#define OV_REAL(name, value) .name = (value),
#define OV_COUNT(name, value) .name = (value),
#include "fit/adaptive/constants.def"
#undef OV_REAL
#undef OV_COUNT
};
#endif

#endif
