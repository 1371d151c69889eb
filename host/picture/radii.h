/*
 * Colours by how far what is seen is from the middle of it all, as pictures of capsids have them.
 */
#ifndef OV_RADII_H
#define OV_RADII_H

#include "picture/rays.h"

/* Middle of the centres of quadrics. */
void ov_middle_of(const ov_quadric *quadrics, size_t count, double middle[3]);

/* Turns the extra of what rays meet into where its distance from the middle lies between radii[0]
 * and radii[1], from -1 to 1, and chooses these so that all but a percent at either end are between
 * them, angstrom; both are 0 where nothing is seen. */
ovoid_status ov_hits_by_radius(ovoid_context *context, const ov_rays *rays, const double middle[3],
                               ov_hits *hits, double radii[2]);

#endif
