/*
 * Ovoid: sparse ellipsoid-Gaussian representation of molecular surfaces.
 *
 * The field of a molecule is phi(x) = sum_i exp(-d (|x - x_i|^2 - r_i^2)), its Gaussian surface the
 * level set phi = c (Gui, Chen, Lu, "Sparse Representation of Gaussian Molecular Surface",
 * arXiv:1909.09095, eqs. 1.1 and 1.2). A model is a list of ellipsoids whose field
 * sum_i a_i exp(-(x - mu_i)^T A_i (x - mu_i)) has nearly the same surface with far fewer terms.
 *
 * This header includes all others but <ovoid/opencl.h>, which needs OpenCL's own headers:
 *
 *   context.h   statuses, versions, contexts, progress, devices
 *   molecule.h  molecules and their atoms      mesh.h     meshes, and distances between them
 *   model.h     models and their ellipsoids    measure.h  how well a model stands for a molecule
 *   fit.h       from a molecule to a model     picture.h  pictures
 *   field.h     fields, and their values       export.h   files for other programs
 *   fitter.h    from a molecule to many models, and along a trajectory
 *   file.h      output files                   selftest.h whether a device computes rightly
 *
 * Conventions of every function:
 * - Lengths are in angstrom, areas in angstrom^2, decay rates in angstrom^-2, angles in radian,
 *   times in second. Coordinates are those of the input file.
 * - A function that can fail returns an ovoid_status. On failure its outputs are untouched (but see
 *   ovoid_fit() of a fit that is stopped) and ovoid_context_error() describes what happened, with
 *   file, line, OpenCL call or device. What can fail takes the context first, for that text, also
 * where it needs nothing else of it.
 * - xxx_destroy(xxx **) frees, sets the pointer to NULL, and accepts NULL and repeats. What a
 *   function hands out as a pointer to const belongs to the object it came from.
 * - NULL, where it has no meaning of its own: a function that returns a status returns
 *   OVOID_ERROR_ARGUMENT and names the argument; one that answers a question answers 0, NULL, NAN
 *   or "", as if of nothing; all others, such as xxx_options_init(), do nothing.
 * - A number that is not known, or makes no sense where it stands, is NAN as a double and
 *   OVOID_UNKNOWN as a uint64_t.
 * - The library prints nothing, never exits, installs no signal handler and does not touch the
 *   environment (but see ovoid_prepare_process()).
 *
 * Structures, and how they grow:
 * - A structure whose first member is `size` may get new members at its end. xxx_init(&x, sizeof x)
 *   makes one of those that the caller fills in or receives: it sets the size and the defaults. The
 *   library takes smaller structures than its own, of programs compiled against an older header,
 *   and uses the defaults for the rest. It takes larger ones where all beyond its own size is zero,
 *   and else refuses them: they ask for something that it does not know. Of results it fills in
 *   what both sides know and leaves the rest, and the size, as they are.
 * - All other structures never change, those within one with a size too: bindings may map them, and
 *   arrays of them, as they are. Their sizes are given where they are declared, for pointers of 64
 *   bits, and asserted in the library.
 * - ovoid_abi() changes when any of this, or a function, changes in a way that programs notice.
 *
 * Threads:
 * - A context and what is made with it may be used by one thread at a time, and by different ones
 *   one after another. Different contexts are independent. What needs no context (molecules and
 *   models, once made, and meshes) may be read by several threads at once.
 * - Callbacks run on the thread that called the library, during that call, and must return: no
 *   longjmp(), no C++ exception. They may use other contexts, and read objects, but of this
 *   context only ovoid_context_error(): what else takes it is refused with OVOID_ERROR_ARGUMENT.
 * - A process that was forked after OpenCL was used (by ovoid_devices(), or anything that works on
 *   a device) cannot use it, since no driver survives that: what would returns OVOID_ERROR_DEVICE
 *   there, in every context, and destroying objects frees memory of the host alone. Fork first, or
 *   exec.
 */
#ifndef OVOID_OVOID_H
#define OVOID_OVOID_H

#include "ovoid/context.h"
#include "ovoid/export.h"
#include "ovoid/field.h"
#include "ovoid/file.h"
#include "ovoid/fit.h"
#include "ovoid/fitter.h"
#include "ovoid/measure.h"
#include "ovoid/mesh.h"
#include "ovoid/model.h"
#include "ovoid/molecule.h"
#include "ovoid/picture.h"
#include "ovoid/selftest.h"

#endif
