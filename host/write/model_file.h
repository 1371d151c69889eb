/*
 * The model file (.ovoid), a text table:
 *
 *     # ovoid model 1
 *     # decay: 0.5
 *     # isovalue: 1
 *     # key: value                                        any number of notes
 *     # amplitude decay1 decay2 decay3 x y z alpha beta gamma
 *     1.02 0.31 0.4 0.52 10.5 -3 7.25 0.1 0 -0.2          one line per ellipsoid
 *
 * Every line that is no ellipsoid begins with '#', so that other programs read it as a plain table.
 * Numbers have nine significant digits and a decimal point in every locale.
 */
#ifndef OV_MODEL_FILE_H
#define OV_MODEL_FILE_H

#include "model/model.h"

#define OV_MODEL_FILE_MAGIC "ovoid model"
#define OV_MODEL_FILE_VERSION 1

#endif
