/*
 * The numbers that steer method l1, ov_l1_tuned.NAME: constants.def has them all.
 */
#ifndef OV_L1_CONSTANTS_H
#define OV_L1_CONSTANTS_H

#include <stdint.h>

typedef struct ov_l1_constants {
#define OV_REAL(name, value) double name;
#define OV_COUNT(name, value) uint32_t name;
#include "fit/l1/constants.def"
#undef OV_REAL
#undef OV_COUNT
} ov_l1_constants;

/* A program that defines OV_TUNABLE compiles this room for itself and varies them. */
#ifdef OV_TUNABLE
extern ov_l1_constants ov_l1_tuned;
#else
static const ov_l1_constants ov_l1_tuned = {
#define OV_REAL(name, value) .name = (value),
#define OV_COUNT(name, value) .name = (value),
#include "fit/l1/constants.def"
#undef OV_REAL
#undef OV_COUNT
};
#endif

#endif
