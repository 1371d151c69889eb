/*
 * What of a mesh hangs together, and how large it is: in parts of the mesh side by side. The parts
 * are the same however many threads there are.
 */
#ifndef OV_COMPONENTS_H
#define OV_COMPONENTS_H

#include "mesh/mesh.h"

/* Fills component_of, which has room for all vertices, components, and the components' counts of
 * vertices. */
ovoid_status ov_components_find(ovoid_context *context, ovoid_mesh *mesh);

/* Counts of triangles, flat areas and volumes, and with these what is outer. Each component has its
 * own origin, one of its vertices, so that little cancels; where it is closed the origin does not
 * matter. */
ovoid_status ov_components_measure(ovoid_context *context, ovoid_mesh *mesh);

#endif
