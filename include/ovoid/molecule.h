/*
 * Molecules: reading them, their radii, which atom is which, assemblies.
 */
#ifndef OVOID_MOLECULE_H
#define OVOID_MOLECULE_H

#include "ovoid/context.h"

#ifdef __cplusplus
extern "C" {
#endif

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
    size_t size;
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

/* Fills in the defaults; size is sizeof *options. */
OVOID_API void ovoid_read_options_init(ovoid_read_options *options, size_t size);

/* What a reader met. Each atom that was left out is counted under the first reason that applies. */
typedef struct ovoid_molecule_counts {
    size_t size;
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

OVOID_API const ovoid_molecule_counts *ovoid_molecule_read_counts(const ovoid_molecule *molecule);

/* The format that was read; AUTO of a molecule from memory. */
OVOID_API ovoid_molecule_format ovoid_molecule_read_format(const ovoid_molecule *molecule);

/* Where the radii came from, never DEFAULT; and its name, "united". */
OVOID_API ovoid_radii ovoid_molecule_radii(const ovoid_molecule *molecule);
OVOID_API const char *ovoid_radii_name(ovoid_radii radii);

/* Number in the file of the model that was read; 1 where it does not tell models apart. */
OVOID_API int32_t ovoid_molecule_model(const ovoid_molecule *molecule);

/* The numbers of all models in the file, *count of them, ascending and each once: fewer than
 * counts.models where two models share a number, of which reading takes the first. 1 alone where
 * the file does not tell models apart. More than a million are OVOID_ERROR_LIMIT when read. */
OVOID_API const int32_t *ovoid_molecule_models(const ovoid_molecule *molecule, size_t *count);

/* ---- which atom is which -------------------------------------------------------------------- */

/* The structures below never change, and are to be mapped by bindings as they are. Text ends
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
 * unit, see ovoid_molecule_origin(). NULL where nobody says anything of the atoms but place and
 * radius: XYZR, and ovoid_molecule_create(). */
OVOID_API const ovoid_atom *ovoid_molecule_identity(const ovoid_molecule *molecule);

/* Residues in the order of their atoms (of the unit), *count of them; one whose atoms are not
 * together is there more than once. NULL and 0 where there is no identity. */
OVOID_API const ovoid_residue *ovoid_molecule_residues(const ovoid_molecule *molecule,
                                                       size_t *count);

/* As ovoid_molecule_create(), of atoms that are known: identity has `atoms` entries, and residues
 * residue_count (both copied, what they do not fill being 0). The atoms of a residue follow one
 * another, in the order of the residues, and each has one at least; `first` and
 * OVOID_ATOM_GUESSED_RADIUS are found here. OVOID_RADII_OWN takes the radii of xyzr; all others
 * replace them, as for a structure's file: DEFAULT is UNITED where there are no hydrogens, else
 * BONDI, and FILE needs radii_file, which is NULL otherwise. */
OVOID_API ovoid_status ovoid_molecule_create_known(ovoid_context *context, const double *xyzr,
                                                   const ovoid_atom *identity, size_t atoms,
                                                   const ovoid_residue *residues,
                                                   size_t residue_count, ovoid_radii radii,
                                                   const char *radii_file,
                                                   ovoid_molecule **molecule);

/* Atoms whose radius had to be guessed, by kind. */
typedef struct ovoid_guess { /* 40 bytes */
    char element[4];         /* "" unknown */
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

typedef struct ovoid_assembly_info { /* 32 bytes */
    char id[16];                     /* "1" */
    uint64_t placements;             /* of all its parts */
    uint64_t atoms; /* that it would have, of the atoms that were read; UINT64_MAX: too many */
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

/* Atoms of a unit that some placements take. */
typedef struct ovoid_unit_part { /* 16 bytes on 64-bit machines */
    const uint32_t *atoms;       /* their numbers, ascending; NULL: all */
    size_t count;                /* of them */
} ovoid_unit_part;

/* As ovoid_molecule_create(), of an assembly: xyzr has the atoms of the unit, parts those that
 * placements take of it, which say by number which part; without parts there is one, of all atoms.
 * `first` of the placements is not read. A placement that is no rotation and translation, or takes
 * atoms beyond 1e6 angstrom, and a part of atoms that there are not are OVOID_ERROR_ARGUMENT. All
 * arrays are copied. */
OVOID_API ovoid_status ovoid_molecule_create_placed(ovoid_context *context, const double *xyzr,
                                                    size_t atoms, const ovoid_unit_part *parts,
                                                    size_t part_count,
                                                    const ovoid_placement *placements,
                                                    size_t placement_count,
                                                    ovoid_molecule **molecule);

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

#ifdef __cplusplus
}
#endif

#endif
