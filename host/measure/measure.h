/*
 * The comparison of two meshes, apart from how they came about.
 */
#ifndef OV_MEASURE_H
#define OV_MEASURE_H

#include "mesh/mesh.h"

/* Fills everything but seconds_mesh. smooth: areas and volumes of the surfaces that the meshes'
 * normals ask for, instead of the flat triangles'. Without distances those stay 0. */
ovoid_status ov_measure_meshes(ovoid_context *context, const ovoid_mesh *original,
                               const ovoid_mesh *sparse, bool smooth, bool distances,
                               ovoid_measures *measures);

/* The two and the error of the second. */
ovoid_pair ov_pair_of(double original, double sparse);

#endif
