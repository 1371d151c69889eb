/*
 * The numbers that steer the adaptive method, ov_tuned.NAME: constants.def has them all.
 */
#ifndef OV_ADAPTIVE_CONSTANTS_H
#define OV_ADAPTIVE_CONSTANTS_H

#define OV_TABLE "fit/adaptive/constants.def"
#define OV_TYPE ov_constants
#define OV_TUNED ov_tuned
#include "base/constants.h"

#endif
