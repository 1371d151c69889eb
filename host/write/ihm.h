/*
 * A model as IHMCIF.
 */
#ifndef OV_IHM_H
#define OV_IHM_H

#include "write/scene.h"

/* The first model of the scene, with the chains and residues of its molecule where that names them.
 */
ovoid_status ov_write_ihm(ovoid_context *context, const ov_scene *scene,
                          const ovoid_export_options *options, const char *title, FILE *stream);

#endif
