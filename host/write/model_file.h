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
 * A model of a unit and its placements has version 2, and before the column line
 *
 *     # placement: r11 r12 r13 r21 r22 r23 r31 r32 r33 t1 t2 t3      one line per placement
 *
 * Every line that is no ellipsoid begins with '#', so that other programs read it as a plain table.
 * Numbers have nine significant digits, those of placements seventeen, and a decimal point in every
 * locale.
 */
#ifndef OV_MODEL_FILE_H
#define OV_MODEL_FILE_H

#include "model/model.h"

#define OV_MODEL_FILE_MAGIC "ovoid model"
/* The least that a model needs, so that older programs read what they can. */
#define OV_MODEL_FILE_VERSION 1
#define OV_MODEL_FILE_VERSION_PLACED 2

#endif
