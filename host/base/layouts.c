/* The layouts that the headers promise to bindings. */
#include "ovoid/ovoid.h"

#include <assert.h>
#include <string.h>

#define PROMISED(type, bytes) static_assert(sizeof(type) == (bytes), #type " has changed")
#define AT(type, member, offset)                                                                   \
    static_assert(offsetof(type, member) == (offset), #type "." #member " has moved")

PROMISED(ovoid_ellipsoid, 10 * sizeof(double));
AT(ovoid_ellipsoid, amplitude, 0);
AT(ovoid_ellipsoid, decay, 1 * sizeof(double));
AT(ovoid_ellipsoid, centre, 4 * sizeof(double));
AT(ovoid_ellipsoid, angle, 7 * sizeof(double));

PROMISED(ovoid_atom, 24);
AT(ovoid_atom, element, 8);
AT(ovoid_atom, altloc, 11);
AT(ovoid_atom, serial, 12);
AT(ovoid_atom, residue, 16);
AT(ovoid_atom, flags, 20);

PROMISED(ovoid_residue, 32);
AT(ovoid_residue, chain, 8);
AT(ovoid_residue, number, 20);
AT(ovoid_residue, insertion, 24);
AT(ovoid_residue, first, 28);

PROMISED(ovoid_placement, 112);
AT(ovoid_placement, translation, 72);
AT(ovoid_placement, part, 96);
AT(ovoid_placement, first, 104);

PROMISED(ovoid_motion, 12 * sizeof(double));
AT(ovoid_motion, translation, 9 * sizeof(double));

PROMISED(ovoid_guess, 40);
AT(ovoid_guess, radius, 24);
PROMISED(ovoid_assembly_info, 32);
AT(ovoid_assembly_info, placements, 16);

PROMISED(ovoid_component, 48);
AT(ovoid_component, area, 16);
AT(ovoid_component, outer, 32);
AT(ovoid_component, euler, 36);
AT(ovoid_component, closed, 40);
AT(ovoid_component, exposed, 41);

PROMISED(ovoid_distances, 5 * sizeof(double));
PROMISED(ovoid_pair, 3 * sizeof(double));
PROMISED(ovoid_l1_options, 80);
PROMISED(ovoid_adaptive_options, 48);
PROMISED(ovoid_parts_options, 12 + 4 + 2 * sizeof(void *));
PROMISED(ovoid_exchange, 8 + 2 * sizeof(void *));
PROMISED(ovoid_l1_progress, 7 * sizeof(double));
PROMISED(ovoid_adaptive_progress, sizeof(double));
PROMISED(ovoid_l1_result, 72);
PROMISED(ovoid_adaptive_result, 8);
PROMISED(ovoid_kernel_time, sizeof(const char *) + 16);

/* Structures that grow begin with their size. */
AT(ovoid_read_options, size, 0);
AT(ovoid_molecule_counts, size, 0);
AT(ovoid_device_info, size, 0);
AT(ovoid_progress, size, 0);
AT(ovoid_fit_options, size, 0);
AT(ovoid_fit_result, size, 0);
AT(ovoid_mesh_options, size, 0);
AT(ovoid_measure_options, size, 0);
AT(ovoid_measures, size, 0);
AT(ovoid_export_options, size, 0);
AT(ovoid_scene, size, 0);
AT(ovoid_picture_options, size, 0);
AT(ovoid_check, size, 0);
AT(ovoid_selftest_options, size, 0);
AT(ovoid_selftest_result, size, 0);

#define SIZE(type)                                                                                 \
    { #type, sizeof(type) }
static const struct {
    const char *type;
    size_t size;
} sizes[] = {SIZE(ovoid_l1_progress),   SIZE(ovoid_adaptive_progress), SIZE(ovoid_progress),
             SIZE(ovoid_device_info),   SIZE(ovoid_kernel_time),       SIZE(ovoid_export_options),
             SIZE(ovoid_l1_options),    SIZE(ovoid_adaptive_options),  SIZE(ovoid_fit_options),
             SIZE(ovoid_l1_result),     SIZE(ovoid_adaptive_result),   SIZE(ovoid_fit_result),
             SIZE(ovoid_pair),          SIZE(ovoid_measure_options),   SIZE(ovoid_measures),
             SIZE(ovoid_mesh_options),  SIZE(ovoid_component),         SIZE(ovoid_distances),
             SIZE(ovoid_ellipsoid),     SIZE(ovoid_read_options),      SIZE(ovoid_molecule_counts),
             SIZE(ovoid_atom),          SIZE(ovoid_residue),           SIZE(ovoid_guess),
             SIZE(ovoid_assembly_info), SIZE(ovoid_placement),         SIZE(ovoid_picture_options),
             SIZE(ovoid_check),         SIZE(ovoid_selftest_options),  SIZE(ovoid_selftest_result),
             SIZE(ovoid_scene),         SIZE(ovoid_parts_options),     SIZE(ovoid_exchange),
             SIZE(ovoid_motion)};
#undef SIZE

size_t ovoid_sizeof(const char *type) {
    for (size_t i = 0; type && i < sizeof sizes / sizeof *sizes; i++)
        if (strcmp(type, sizes[i].type) == 0)
            return sizes[i].size;
    return 0;
}
