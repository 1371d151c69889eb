/*
 * The numbers that steer method l1, ov_l1_tuned.NAME: constants.def has them all.
 */
#ifndef OV_L1_CONSTANTS_H
#define OV_L1_CONSTANTS_H

#define OV_TABLE "fit/l1/constants.def"
#define OV_TYPE ov_l1_constants
#define OV_TUNED ov_l1_tuned
#include "base/constants.h"

#endif
