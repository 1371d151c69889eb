/*
 * Ovoid: sparse ellipsoid-Gaussian representation of molecular surfaces.
 *
 * The field of a molecule is phi(x) = sum_i exp(-d (|x - x_i|^2 - r_i^2)), its Gaussian surface the
 * level set phi = c (Gui, Chen, Lu, "Sparse Representation of Gaussian Molecular Surface",
 * arXiv:1909.09095, eqs. 1.1 and 1.2). A model is a list of ellipsoids whose field
 * sum_i a_i exp(-(x - mu_i)^T A_i (x - mu_i)) has nearly the same surface with far fewer terms.
 *
 * Conventions of every function here:
 * - Lengths are in angstrom, areas in angstrom^2, decay rates in angstrom^-2, angles in radian,
 *   times in second. Coordinates are those of the input file.
 * - A function that can fail returns an ovoid_status. On failure its outputs are untouched (but for
 *   fits that are stopped: see ovoid_fit()) and ovoid_context_error() describes what happened, with
 * file, line, OpenCL call or device.
 * - xxx_destroy(xxx **) frees, sets the pointer to NULL, and accepts NULL and repeats. Whatever a
 *   function hands out as a pointer to const belongs to the object it came from.
 * - NULL, where it has no meaning of its own: a function that returns a status returns
 *   OVOID_ERROR_ARGUMENT and names the argument; one that answers a question answers 0, NULL, NAN
 *   or "", as if of nothing; all others, such as xxx_options_init(), do nothing.
 * - The library prints nothing, never exits, installs no signal handler and does not touch the
 *   environment (but see ovoid_prepare_process()).
 * - A context and what is made with it may be used by one thread at a time; different contexts are
 *   independent.
 */
#ifndef OVOID_OVOID_H
#define OVOID_OVOID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define OVOID_API __attribute__((visibility("default")))
#else
#define OVOID_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- status ------------------------------------------------------------------------------- */

typedef enum ovoid_status {
    OVOID_OK = 0,
    OVOID_ERROR_ARGUMENT,  /* an argument or option is out of its range */
    OVOID_ERROR_MEMORY,    /* the host or the device is out of memory */
    OVOID_ERROR_IO,        /* a file cannot be opened, read or written */
    OVOID_ERROR_FORMAT,    /* a file's contents are not what its format asks for */
    OVOID_ERROR_EMPTY,     /* a molecule or model without any atom or ellipsoid that counts */
    OVOID_ERROR_DEVICE,    /* no OpenCL device, or none that matches the selector */
    OVOID_ERROR_OPENCL,    /* an OpenCL call failed or a kernel did not build */
    OVOID_ERROR_CANCELLED, /* a progress callback asked to stop */
    OVOID_ERROR_LIMIT,     /* the job is larger than an implementation limit */
    OVOID_ERROR_NUMERIC    /* the computation produced a value that is not finite */
} ovoid_status;

/* Version of the library, "MAJOR.MINOR.PATCH". */
OVOID_API const char *ovoid_version(void);

/* Short lower-case name of a status, e.g. "format"; "unknown" for other values. */
OVOID_API const char *ovoid_status_name(ovoid_status status);

/* ---- context ------------------------------------------------------------------------------ */

/* Holds the last error and, once opened, the device with its compiled programs and buffers. */
typedef struct ovoid_context ovoid_context;

/* Creates a context; opens no device yet. */
OVOID_API ovoid_status ovoid_context_create(ovoid_context **context);
OVOID_API void ovoid_context_destroy(ovoid_context **context);

/* Text of the last failure in this context, "" when there was none. One or more lines, no newline
 * at the end. Valid until the next failure or the context's end. */
OVOID_API const char *ovoid_context_error(const ovoid_context *context);

/* Called with one line of text for each condition that does not stop the work, such as an OpenCL
 * platform that does not answer or a program cache that cannot be written. NULL ignores them. */
typedef void (*ovoid_warning_fn)(const char *text, void *user);
OVOID_API void ovoid_context_on_warning(ovoid_context *context, ovoid_warning_fn fn, void *user);

/* ---- progress ----------------------------------------------------------------------------- */

/* What a function that may take long is doing. */
typedef struct ovoid_progress {
    const char *stage;    /* one word: "read" or "write" (a file), "open" (a device), "compile"
                             (kernels), "field", "mesh", "measure" (distances), "map", "render"; of
                             a fit also "sample"; of l1 "sparse" or "accuracy"; of adaptive "merge",
                             "refine", "repair", "grow" or "shrink" */
    uint64_t done, total; /* of this stage, in parts of its own; total 0: nobody knows how many */
    double seconds;       /* since the function that was called began */
    /* The rest is of fits alone, else 0. */
    uint64_t iteration;  /* 1 .. iterations; 0 before the first */
    uint64_t iterations; /* how many there will be at most; 0 where nobody knows (adaptive) */
    uint64_t ellipsoids;
    uint64_t points;      /* while sampling, so far */
    double accuracy_term; /* E_s = sum_k (phi~ - phi)^2 over the constrained points; of adaptive the
                             sum of weighted squared residuals */
    double sparse_term;   /* E_l1 = sum_i |c_i| + |d_i1| + |d_i2| + |d_i3|, square-root variables */
    double accuracy_weight; /* w_s */
    double sparse_weight;   /* w_l */
    double objective;       /* w_s E_s + w_l E_l1 */
    double max_error;       /* max_k |phi~ - phi| */
    double step;            /* tau of the line search, 0 where no descent was found */
} ovoid_progress;

/* Returns true to go on, false to stop: the function that was called then frees what it has made,
 * leaves its outputs untouched and no file behind, and returns OVOID_ERROR_CANCELLED; a fit hands
 * over the best model that held (see ovoid_fit()). */
typedef bool (*ovoid_progress_fn)(const ovoid_progress *progress, void *user);

/* Calls fn from now on while a function with this context is at work that may take long: reading,
 * writing, opening a device, compiling kernels, fields, fits, meshes, distances, measures, maps,
 * pictures. NULL, as at first: none.
 *
 * It is called on the thread that called the library, often: before every launch of a kernel and
 * between pieces of what is done on the host, the same state more than once, in a fit also after
 * each iteration. On a usual device a few milliseconds lie between two calls, and seldom more than
 * half a second; what a driver does in one go, such as compiling, is not interrupted. It should
 * return soon. It may use other contexts and read what objects hold, but not call what takes this
 * context, except ovoid_context_error(), and must return: no longjmp(), no C++ exception. *progress
 * and its text are valid until then. */
OVOID_API void ovoid_context_on_progress(ovoid_context *context, ovoid_progress_fn fn, void *user);

/* ---- devices ------------------------------------------------------------------------------ */

/* For a program to call at its beginning, before it has other threads and before it uses OpenCL:
 * where PoCL cannot keep compiled kernels in its folder (full, not writable, or on a file system
 * mounted noexec, which would end the process), POCL_CACHE_DIR is set to another one. This is the
 * only function that touches the environment, which no thread may read meanwhile; a program that
 * does not call it loses PoCL's devices in such a case. The first context that lists devices warns
 * of what was done. */
OVOID_API void ovoid_prepare_process(void);

typedef enum ovoid_device_type {
    OVOID_DEVICE_CPU,
    OVOID_DEVICE_GPU,
    OVOID_DEVICE_ACCELERATOR,
    OVOID_DEVICE_OTHER
} ovoid_device_type;

typedef struct ovoid_device_info {
    uint32_t index; /* position in the list of all devices of all platforms, from 0 */
    ovoid_device_type type;
    char name[128];
    char vendor[128];
    char platform[128];
    char driver[64]; /* driver version */
    char opencl[64]; /* e.g. "OpenCL 3.0 ..." as the device reports it */
    uint32_t compute_units;
    uint32_t clock_mhz;
    uint32_t float_width;    /* preferred vector width for float */
    bool fp64;               /* double precision in kernels; Ovoid does not need it */
    uint64_t global_memory;  /* bytes, as the driver reports them */
    uint64_t max_allocation; /* bytes of one buffer */
} ovoid_device_info;

/* Lists every device of every platform. A platform that fails is skipped with a warning. *devices
 * is an array of *count entries to be freed with ovoid_free(). No device at all is not an error
 * here: *count is 0 and *devices NULL. */
OVOID_API ovoid_status ovoid_devices(ovoid_context *context, ovoid_device_info **devices,
                                     size_t *count);

/* Opens the device that selector names: an index ("0"), a type ("cpu", "gpu", "accelerator") or
 * part of a device or platform name in any case. NULL or "" takes the environment variable
 * OVOID_DEVICE, and without it the first GPU, else the first device. The first device whose match
 * is found is taken. Replaces the device opened before; objects made on that one must be gone. */
OVOID_API ovoid_status ovoid_context_open_device(ovoid_context *context, const char *selector);

/* The opened device, NULL before one is opened. */
OVOID_API const ovoid_device_info *ovoid_context_device(const ovoid_context *context);

/* What a kernel took on the device. */
typedef struct ovoid_kernel_time {
    const char *name; /* of the kernel, in kernels/; belongs to the library */
    uint64_t launches;
    double seconds; /* by the device's clock, the sum of all launches; NAN where the driver does not
                       tell them all */
} ovoid_kernel_time;

/* Counts and times each kernel launched from now on, on the opened device and on those opened later
 * (true), or no longer (false, as it is at first). May be called at any time: waits for what is
 * under way. true begins with no kernels, and so does opening a device; after false the times can
 * still be had. Results do not change, and without it nothing is spent on it. */
OVOID_API ovoid_status ovoid_context_profile(ovoid_context *context, bool on);

/* What was counted, the longest first: *times is an array of *count entries to be freed with
 * ovoid_free(), NULL when there are none. Waits for what is under way. */
OVOID_API ovoid_status ovoid_context_kernel_times(ovoid_context *context, ovoid_kernel_time **times,
                                                  size_t *count);

/* Frees memory that the library handed over; NULL is fine. */
OVOID_API void ovoid_free(void *memory);

/* ---- molecules ---------------------------------------------------------------------------- */

typedef struct ovoid_molecule ovoid_molecule;

/* Formats of molecule files. AUTO goes by the extension (.pqr, .xyzr, .pdb, .ent, .cif, .mmcif; .gz
 * of each), and where that says nothing, by the contents. A PDB file named .pqr is taken for what
 * it is. */
typedef enum ovoid_molecule_format {
    OVOID_MOLECULE_AUTO = 0,
    OVOID_MOLECULE_PQR,
    OVOID_MOLECULE_XYZR,
    OVOID_MOLECULE_PDB,
    OVOID_MOLECULE_MMCIF
} ovoid_molecule_format;

/* Where radii come from. */
typedef enum ovoid_radii {
    OVOID_RADII_DEFAULT = 0, /* the file's own (PQR, XYZR); of a structure UNITED where it has no
                                hydrogens, else BONDI */
    OVOID_RADII_OWN,         /* the file's own, or those given to ovoid_molecule_create() */
    OVOID_RADII_BONDI,       /* by element: Bondi's, and for metals and what he does not list
                                Alvarez's van der Waals radii */
    OVOID_RADII_PAPER,       /* by element, as in the inputs of the paper: BONDI, but O 1.5 and P
                                1.85 angstrom */
    OVOID_RADII_UNITED,      /* by residue and atom: radii of C, N, O and S that also stand for the
                                hydrogens that the file lacks; BONDI for other elements */
    OVOID_RADII_FILE         /* a file with lines "residue atom radius" or "element radius" */
} ovoid_radii;

/* What to read and how. Members that a format knows nothing of are errors where they ask for
 * something: an XYZR file has neither models, waters, hydrogens, names nor elements. */
typedef struct ovoid_read_options {
    size_t size; /* of this structure: set by ovoid_read_options_init() */
    ovoid_molecule_format format;
    ovoid_radii radii;      /* other than DEFAULT and OWN, they replace those of a PQR file */
    const char *radii_file; /* for OVOID_RADII_FILE; "-" is not allowed */
    const char *select;     /* atoms to keep, in gemmi's syntax, such as "/1/A,B", "A/10-60" or
                               "[!C]"; NULL keeps all */
    int32_t model;          /* its number in the file; 0: the first */
    bool waters;            /* keep those of PDB and mmCIF files (those of PQR stay in any case) */
    bool no_hydrogens;      /* leave out hydrogen and deuterium */
    const char *assembly;   /* make the molecule this assembly of the file (see below); NULL: the
                               atoms as they are there */
} ovoid_read_options;

/* Fills in the defaults. size is that of *options: sizeof(ovoid_read_options). */
OVOID_API void ovoid_read_options_init(ovoid_read_options *options, size_t size);

/* What a reader met. Each atom that was left out is counted under the first reason that applies. */
typedef struct ovoid_molecule_counts {
    uint64_t lines;             /* lines read */
    uint64_t atoms;             /* atoms in the molecule */
    uint64_t unit_atoms;        /* of the file that are in it: as many, unless it is an assembly */
    uint64_t zero_radius;       /* of these, with radius 0 */
    uint64_t hydrogens;         /* of these, hydrogen or deuterium; 0 where elements are unknown */
    uint64_t zero_occupancy;    /* of these, with occupancy 0 */
    uint64_t guessed_radii;     /* of these, whose radius stands for an unknown element or atom */
    uint64_t models;            /* in the file; 1 where it does not tell models apart */
    uint64_t skipped;           /* records that hold an atom but were left out, and why: */
    uint64_t skipped_models;    /* ... of other models */
    uint64_t skipped_waters;    /* ... of waters */
    uint64_t skipped_hydrogens; /* ... hydrogens, by no_hydrogens */
    uint64_t skipped_selection; /* ... not selected */
    uint64_t skipped_assembly;  /* ... of chains that are not in the assembly */
    uint64_t skipped_altlocs;   /* ... at other alternate locations than the chosen ones */
} ovoid_molecule_counts;

/* Reads a molecule; gzip is recognised by content; "-" is standard input. A bad line is
 * OVOID_ERROR_FORMAT with "file:line:column: reason". A file without atoms, or none that is kept,
 * is OVOID_ERROR_EMPTY. Memory follows the atoms, not the file, also where gzip makes it small:
 * what no file has so many of (names in a loop, parts of an assembly) is OVOID_ERROR_LIMIT. Of
 * alternate locations, one conformer of each residue is kept: that of the highest mean occupancy,
 * of equal ones the first. */
OVOID_API ovoid_status ovoid_molecule_read(ovoid_context *context, const char *path,
                                           ovoid_molecule_format format, ovoid_molecule **molecule);

/* The same with all choices; options may be NULL for the defaults. A bad option, such as a
 * selection that makes no sense, is OVOID_ERROR_ARGUMENT. */
OVOID_API ovoid_status ovoid_molecule_read_with(ovoid_context *context, const char *path,
                                                const ovoid_read_options *options,
                                                ovoid_molecule **molecule);

/* Makes a molecule of `atoms` atoms from xyzr[4 * i + {0, 1, 2, 3}] = x, y, z, radius (angstrom).
 * Values must be finite, coordinates within 1e6 angstrom of the origin along each axis, radii 0 to
 * 100 angstrom, and there must be an atom; the same holds for files. The array is copied. */
OVOID_API ovoid_status ovoid_molecule_create(ovoid_context *context, const double *xyzr,
                                             size_t atoms, ovoid_molecule **molecule);

OVOID_API void ovoid_molecule_destroy(ovoid_molecule **molecule);

OVOID_API size_t ovoid_molecule_atoms(const ovoid_molecule *molecule);

/* x, y, z, radius of all atoms, 4 * atoms values, in the order of the file; of an assembly
 * placement after placement. Those of an assembly are computed when first asked for: NULL where
 * there is no memory for them. */
OVOID_API const double *ovoid_molecule_xyzr(const ovoid_molecule *molecule);

OVOID_API ovoid_molecule_counts ovoid_molecule_read_counts(const ovoid_molecule *molecule);

/* The format that was read; AUTO of a molecule from memory. */
OVOID_API ovoid_molecule_format ovoid_molecule_read_format(const ovoid_molecule *molecule);

/* Where the radii came from, never DEFAULT; and its name, "united". */
OVOID_API ovoid_radii ovoid_molecule_radii(const ovoid_molecule *molecule);
OVOID_API const char *ovoid_radii_name(ovoid_radii radii);

/* Number in the file of the model that was read; 1 where it does not tell models apart. */
OVOID_API int32_t ovoid_molecule_model(const ovoid_molecule *molecule);

/* ---- which atom is which -------------------------------------------------------------------- */

/* The structures below are arrays of fixed layout, to be mapped by bindings as they are. Text ends
 * in a zero byte and is filled up with zeros; longer text is cut, with a warning. Control
 * characters in it are '?'. */

/* A residue number that the file does not give. */
#define OVOID_NO_NUMBER INT32_MIN

enum {
    OVOID_ATOM_HETERO = 1,         /* HETATM */
    OVOID_ATOM_ZERO_OCCUPANCY = 2, /* occupancy 0 */
    OVOID_ATOM_GUESSED_RADIUS = 4  /* its radius stands for an unknown element or atom */
};

typedef struct ovoid_atom { /* 24 bytes */
    char name[8];           /* "CA" */
    char element[3];        /* "C", "Zn", "D"; "" unknown */
    char altloc;            /* of the location that was chosen, 0 for none */
    int32_t serial;         /* number in the file; 0 where it gives none */
    uint32_t residue;       /* index in ovoid_molecule_residues() */
    uint32_t flags;         /* OVOID_ATOM_... */
} ovoid_atom;

typedef struct ovoid_residue { /* 32 bytes */
    char name[8];              /* "ALA" */
    char chain[12];            /* the author's (auth_asym_id of mmCIF) */
    int32_t number;            /* the author's; OVOID_NO_NUMBER for none */
    char insertion;            /* code, 0 for none */
    char reserved[3];
    uint32_t first; /* its first atom; it ends where the next residue begins */
} ovoid_residue;

/* One entry per atom, in the order of ovoid_molecule_xyzr(); of an assembly one per atom of the
 * unit, see ovoid_molecule_origin(). NULL where the file says nothing of its atoms but place and
 * radius: XYZR, and molecules from memory. */
OVOID_API const ovoid_atom *ovoid_molecule_identity(const ovoid_molecule *molecule);

/* Residues in the order of their atoms (of the unit), *count of them; one whose atoms are not
 * together is there more than once. NULL and 0 where there is no identity. */
OVOID_API const ovoid_residue *ovoid_molecule_residues(const ovoid_molecule *molecule,
                                                       size_t *count);

/* Atoms whose radius had to be guessed, by kind. */
typedef struct ovoid_guess {
    char element[4]; /* "" unknown */
    char residue[8], atom[8];
    double radius;  /* what they got, angstrom */
    uint64_t atoms; /* how many */
} ovoid_guess;

/* The kinds, *count of them, the first 64 at most; counts.guessed_radii has all atoms. */
OVOID_API const ovoid_guess *ovoid_molecule_guesses(const ovoid_molecule *molecule, size_t *count);

/* ---- assemblies ----------------------------------------------------------------------------- */

/*
 * An assembly is a unit, the atoms of the file that take part in it, and its placements: for each,
 * a rotation and a translation of a part of the unit. Most have one part, which is the whole unit;
 * those that do different things with different chains have several. Files describe them in
 * _pdbx_struct_assembly_gen (mmCIF) or REMARK 350 (PDB, and PQR files that kept it).
 */

typedef struct ovoid_assembly_info {
    char id[16];         /* "1" */
    uint64_t placements; /* of all its parts */
    uint64_t atoms;      /* that it would have, of the atoms that were read; UINT64_MAX: too many */
} ovoid_assembly_info;

/* The assemblies that the file describes, *count of them; NULL and 0 for none. */
OVOID_API const ovoid_assembly_info *ovoid_molecule_assemblies(const ovoid_molecule *molecule,
                                                               size_t *count);

typedef struct ovoid_placement { /* 112 bytes */
    double rotation[9];          /* row by row: x' = rotation x + translation */
    double translation[3];       /* angstrom */
    uint32_t part;               /* which atoms, see ovoid_molecule_part() */
    uint32_t reserved;
    uint64_t first; /* index of its first atom among all */
} ovoid_placement;

/* The placements of a molecule that was read as an assembly, *count of them; NULL and 0 of one that
 * was not. */
OVOID_API const ovoid_placement *ovoid_molecule_placements(const ovoid_molecule *molecule,
                                                           size_t *count);

/* The atoms of the unit that belong to a part, ascending, *count of them; NULL with a *count above
 * 0: all. */
OVOID_API const uint32_t *ovoid_molecule_part(const ovoid_molecule *molecule, uint32_t part,
                                              size_t *count);

/* The unit: its atoms as the file has them. Of a molecule that is no assembly, all of it. */
OVOID_API size_t ovoid_molecule_unit_atoms(const ovoid_molecule *molecule);
OVOID_API const double *ovoid_molecule_unit_xyzr(const ovoid_molecule *molecule);

/* Which atom of the unit this one of all atoms is, and in which placement (NULL: not asked). */
OVOID_API size_t ovoid_molecule_origin(const ovoid_molecule *molecule, size_t atom,
                                       size_t *placement);

/* Computes all atoms of an assembly now, and says so if there is no memory for them: 32 bytes for
 * each. What works on all atoms does it by itself. */
OVOID_API ovoid_status ovoid_molecule_expand(ovoid_context *context,
                                             const ovoid_molecule *molecule);

/* ---- output files -------------------------------------------------------------------------- */

/* A file that is whole or absent: its bytes go to a temporary file in the same folder, which takes
 * the final name at the end. Symbolic links are followed and stay, and a file that is replaced
 * keeps its permissions. "-" is standard output. What exists and is no regular file (a device, a
 * FIFO) is written in place. ovoid_model_write() writes this way; so can what goes beside a model.
 */
typedef struct ovoid_file ovoid_file;

/* OVOID_ERROR_IO if a file could not be written at `path` now, with the reason: no such folder, no
 * permission, a folder in its place. Changes nothing; made to be asked before long work. */
OVOID_API ovoid_status ovoid_file_check(ovoid_context *context, const char *path);

OVOID_API ovoid_status ovoid_file_create(ovoid_context *context, const char *path,
                                         ovoid_file **file);

/* Appends `bytes` bytes, buffered. */
OVOID_API ovoid_status ovoid_file_write(ovoid_context *context, ovoid_file *file, const void *data,
                                        size_t bytes);

/* Removes the temporary files of all outputs under way in this process, in every context. For a
 * signal handler that is about to end the process, and safe there (async-signal-safe): whoever
 * writes one of the files meets an error afterwards. */
OVOID_API void ovoid_remove_temporaries(void);

/* Writes out what is buffered and gives the file its name. On success and on failure alike the file
 * takes no more data; on failure nothing is left of it. */
OVOID_API ovoid_status ovoid_file_commit(ovoid_context *context, ovoid_file *file);

/* Drops the file; one that was not committed leaves nothing behind. */
OVOID_API void ovoid_file_destroy(ovoid_file **file);

/* ---- field -------------------------------------------------------------------------------- */

#define OVOID_DEFAULT_DECAY 0.5    /* d, angstrom^-2 (section 3.2.3 of the paper) */
#define OVOID_DEFAULT_ISOVALUE 1.0 /* c (Table 2 of the paper) */

/* phi and, unless gradient is NULL, its gradient (angstrom^-1) at `count` points xyz[3 * k + {0, 1,
 * 2}], computed on the device in single precision. value has count entries, gradient 3 * count.
 * decay in angstrom^-2.
 *
 * Relative error of phi about 1e-6, and of its gradient's length a few times that, however far the
 * molecule extends: each 16 points or fewer have an origin of their own. Each Gaussian counts where
 * it is at least 1e-7; where none is, phi and its gradient are 0, as far out as a point may be. A
 * point that is not finite is OVOID_ERROR_ARGUMENT. */
OVOID_API ovoid_status ovoid_molecule_field(ovoid_context *context, const ovoid_molecule *molecule,
                                            double decay, const double *xyz, size_t count,
                                            double *value, double *gradient);

/* ---- models ------------------------------------------------------------------------------- */

/* One ellipsoid in the paper's convention: amplitude * exp(-(x - centre)^T A (x - centre)) with
 * A = R^T diag(decay) R and R = R_z(angle[2]) R_y(angle[1]) R_x(angle[0]), the paper's signs (eqs.
 * 2.11 to 2.14; its R_y is the transpose of the usual one). */
typedef struct ovoid_ellipsoid {
    double amplitude; /* a > 0 */
    double decay[3];  /* angstrom^-2, > 0 */
    double centre[3]; /* angstrom */
    double angle[3];  /* alpha, beta, gamma, radian */
} ovoid_ellipsoid;

typedef struct ovoid_model ovoid_model;

/* Makes a model of `count` ellipsoids (copied) that stands for a surface with this decay rate and
 * isovalue. Values must be finite, amplitudes and decay rates positive. */
OVOID_API ovoid_status ovoid_model_create(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                          size_t count, double decay, double isovalue,
                                          ovoid_model **model);
OVOID_API void ovoid_model_destroy(ovoid_model **model);

OVOID_API size_t ovoid_model_size(const ovoid_model *model);
OVOID_API const ovoid_ellipsoid *ovoid_model_ellipsoids(const ovoid_model *model);
OVOID_API double ovoid_model_decay(const ovoid_model *model);
OVOID_API double ovoid_model_isovalue(const ovoid_model *model);

/* For each atom of the molecule that the model was fitted to, in the molecule's order, the index
 * (from 0) of the ellipsoid that it became part of. NULL where nobody knows: owners are kept by
 * ovoid_fit(), not by model files.
 * - adaptive: the ellipsoid into which the atom's Gaussian was merged. When an ellipsoid is split,
 *   each of its atoms goes to the half with the larger value at the atom's centre, and one at least
 *   to each half; a half of an ellipsoid of one atom may own none.
 * - l1: the ellipsoid that the atom's Gaussian became; where that one was deleted, the ellipsoid
 *   with the largest value at the atom's centre. Every ellipsoid owns at least one atom. */
OVOID_API const uint32_t *ovoid_model_owner(const ovoid_model *model);

/* Entries of ovoid_model_owner(): atoms of that molecule; 0 where nobody knows. */
OVOID_API size_t ovoid_model_owner_count(const ovoid_model *model);

/* Header lines of a model file, "key: value" each, without '#'. NULL past the end. They come from
 * the file read, or from ovoid_model_annotate(). */
OVOID_API const char *ovoid_model_note(const ovoid_model *model, size_t index);

/* Adds a header line; key and value hold no line breaks. */
OVOID_API ovoid_status ovoid_model_annotate(ovoid_context *context, ovoid_model *model,
                                            const char *key, const char *value);

/* Reads a model file (.ovoid). "-" is standard input. Bad lines are OVOID_ERROR_FORMAT with
 * "file:line:column: reason". */
OVOID_API ovoid_status ovoid_model_read(ovoid_context *context, const char *path,
                                        ovoid_model **model);

/* Writes a model file: '#' header lines, a column line, one ellipsoid per line with nine
 * significant digits. "-" is standard output. A file is written beside its final place and renamed,
 * so that `path` never holds half a model. */
OVOID_API ovoid_status ovoid_model_write(ovoid_context *context, const ovoid_model *model,
                                         const char *path);

/* As ovoid_molecule_field(), for the model's field. */
OVOID_API ovoid_status ovoid_model_field(ovoid_context *context, const ovoid_model *model,
                                         const double *xyz, size_t count, double *value,
                                         double *gradient);

/* ---- fitting ------------------------------------------------------------------------------ */

/* Of the constrained points, angstrom. */
#define OVOID_DEFAULT_SPACING_ADAPTIVE                                                             \
    0.7                               /* less for molecules of less than 640 atoms, and times      \
                                         sqrt(0.5 / decay) for decays above 0.5 */
#define OVOID_DEFAULT_SPACING_L1 1.25 /* bench/l1_settings.py says why */

typedef enum ovoid_method {
    OVOID_METHOD_ADAPTIVE = 0, /* merges the atoms' Gaussians, then fits what is left to the
                                  surface: fewer ellipsoids, nearer to it, in a fraction of the
                                  time */
    OVOID_METHOD_L1            /* the paper's Algorithm 1 */
} ovoid_method;

/* What each atom's Gaussian may become. */
typedef enum ovoid_kernel {
    OVOID_KERNEL_ELLIPSOID = 0, /* the paper's model: all ten parameters move, E_l1 is eq. 3.3 */
    OVOID_KERNEL_SPHERE /* the "sparse RBF" model that Table 1 compares with: spheres of decay d
                           at the atoms, only amplitudes move, E_l1 is sum_i |c_i| */
} ovoid_kernel;

/* The step that the line search tries first (open in the paper, which asks for an inexact search
 * along the negative gradient). */
typedef enum ovoid_first_step {
    OVOID_FIRST_STEP_SECANT = 0, /* Barzilai and Borwein's, where the last two gradients are of E_s
                                    alone; else as GROW */
    OVOID_FIRST_STEP_GROW        /* grow times the last accepted step */
} ovoid_first_step;

/* Constants of the paper's Algorithm 1. Those marked "open" are not given in the paper. */
typedef struct ovoid_l1_options {
    ovoid_kernel kernel;         /* ELLIPSOID */
    uint32_t iterations;         /* MaxNiter: 8000 (section 4.1, ADP) */
    uint32_t sparse_iterations;  /* SparseNiter: 6000 (section 4.1, ADP) */
    uint32_t inside_every;       /* beyond the paper: of the lattice points with phi > c + 1, those
                                    whose three indices are multiples of this hold the inside, where
                                    phi~ is not to fall below c + 1: their residual is
                                    min(phi~ - (c + 1), 0). 0: none, the paper's text taken
                                    literally */
    double epsilon;              /* lower bound of w_s in step 5.4 (open) */
    double max_error;            /* gate of step 5.5: 0.5 */
    double prune_below;          /* tol of step 5.1: |c~| under it is deleted: 1e-3 */
    uint32_t prune_every;        /* iterations between deletions: 20 */
    ovoid_first_step first_step; /* of the line search (open): SECANT */
    double armijo;               /* sufficient decrease of the line search (open): 1e-4 */
    double shrink;               /* factor of a rejected step (open): 0.5 */
    double grow;                 /* of the last accepted step, for the next first one (open): 2 */
    uint32_t max_backtracks;     /* trial steps of one search before giving up (open): 30 */
} ovoid_l1_options;

/* What the adaptive method is to reach. */
typedef enum ovoid_goal {
    OVOID_GOAL_TOLERANCE = 0, /* the outer surfaces are nowhere further apart than `tolerance`, with
                                 as few ellipsoids as it finds */
    OVOID_GOAL_ELLIPSOIDS,    /* `ellipsoids` of them */
    OVOID_GOAL_RATIO          /* `ratio` ellipsoids per atom, at least one */
} ovoid_goal;

/* Half an angstrom: what an atom of a well-ordered crystal moves by itself (B = 20 angstrom^2 is a
 * root mean square displacement of 0.5 angstrom along each axis). */
#define OVOID_DEFAULT_TOLERANCE 0.5

typedef struct ovoid_adaptive_options {
    ovoid_goal goal;     /* TOLERANCE */
    double tolerance;    /* angstrom: OVOID_DEFAULT_TOLERANCE */
    uint32_t ellipsoids; /* for OVOID_GOAL_ELLIPSOIDS; more than atoms is an error */
    double ratio;        /* for OVOID_GOAL_RATIO, at most 1 */
    uint32_t effort;     /* 1 (the default) to 10: how many starts and repairs are tried */
    uint32_t steps;      /* Levenberg-Marquardt steps of one refinement at most: 60; 0 leaves the
                            merged Gaussians as they are */
    double mesh_spacing; /* of the meshes that surfaces are judged on, angstrom: 0.5 */
} ovoid_adaptive_options;

typedef struct ovoid_fit_options {
    ovoid_method method;
    double decay;    /* d, angstrom^-2 */
    double isovalue; /* c */
    double spacing;  /* of the lattice of constrained points, angstrom (open); 0: the method's own,
                        OVOID_DEFAULT_SPACING_... */
    double padding;  /* of the box about the atom centres, angstrom (open); adaptive takes what the
                        field needs, if that is more */
    ovoid_adaptive_options adaptive;
    ovoid_l1_options l1;
} ovoid_fit_options;

/* Where the time of a fit went, and how much was done. The seconds are measured on the host between
 * waits for the device, so they include launches. Method adaptive waits too seldom for that: of it,
 * only launches are filled in, sampling included, and all else is 0. ovoid_context_profile() tells
 * the times of kernels for both methods. */
typedef struct ovoid_fit_profile {
    double lists_seconds;   /* building the pack lists */
    double field_seconds;   /* phi~ and the residual, including every trial step */
    double moments_seconds; /* sums for the gradient */
    double host_seconds;    /* parameter updates and the chain rule */
    uint64_t list_builds;
    uint64_t field_passes;
    uint64_t moments_passes;
    uint64_t launches; /* kernels enqueued */
} ovoid_fit_profile;

/* Whether the goal of method adaptive was reached, and if not, why. */
typedef enum ovoid_verdict {
    OVOID_VERDICT_REACHED = 0,
    OVOID_VERDICT_MISSED, /* measured, and further apart than asked; or not so many ellipsoids */
    OVOID_VERDICT_NO_SURFACE, /* there is none to be near to: the molecule's field is nowhere above
                                 the isovalue at the lattice points. The model follows the field
                                 then */
    OVOID_VERDICT_NO_MODEL_SURFACE, /* the model has none */
    OVOID_VERDICT_COARSE /* mesh_spacing is above both the tolerance and 2 / sqrt(2 decay), or
                            parts of the surface are too small for it: nothing that was measured
                            would tell */
} ovoid_verdict;

typedef struct ovoid_fit_result {
    double spacing;  /* of the constrained points, angstrom: what was asked for or the default */
    uint64_t points; /* constrained points */
    uint64_t ellipsoids;
    uint64_t iterations; /* done */
    double rms_error;    /* of l1: sqrt(E_s / points); of adaptive 0 */
    double max_error;    /* of l1: max_k |phi~ - phi| over the constrained points; of adaptive 0 */
    bool reached; /* the goal, as measured: verdict is OVOID_VERDICT_REACHED. Always true of l1,
                     which has no goal */
    ovoid_verdict verdict;
    double distance; /* largest between the outer surfaces, measured, angstrom: right to 1e-7 of the
                        molecule's half extent; NAN where it was not measured (l1, no surface, or
                        too coarse a mesh) */
    uint64_t solver_iterations; /* of conjugate gradients (adaptive) */
    double sample_seconds;
    double fit_seconds;
    ovoid_fit_profile profile;
} ovoid_fit_result;

/* Fills in the defaults. */
OVOID_API void ovoid_fit_options_init(ovoid_fit_options *options);

/* Fits a model to a molecule's surface on the opened device (opening the default one if none is).
 * The same input, options, device and driver give the same bits. result may be NULL. A fit that the
 * progress callback stops (OVOID_ERROR_CANCELLED) hands over the best model that held by then, or
 * sets *model to NULL, as ovoid_fitter_reach() does (fitter.h). For more than one fit of a molecule
 * make an ovoid_fitter. */
OVOID_API ovoid_status ovoid_fit(ovoid_context *context, const ovoid_molecule *molecule,
                                 const ovoid_fit_options *options, ovoid_model **model,
                                 ovoid_fit_result *result);

#ifdef __cplusplus
}
#endif

#include "ovoid/fitter.h"

#endif
