#include "fit.h"

#include <stdlib.h>
#include <string.h>

static bool same_residue(const ovoid_residue *a, const ovoid_residue *b) {
    return strcmp(a->name, b->name) == 0 && strcmp(a->chain, b->chain) == 0 &&
           a->number == b->number && a->insertion == b->insertion;
}

/* Serial numbers and locations may differ: who the atoms are is what counts. */
static bool same_identity(const ovoid_molecule *m, const ovoid_molecule *n) {
    const ovoid_atom *const a = ovoid_molecule_identity(m), *const b = ovoid_molecule_identity(n);
    const ovoid_residue *const r = ovoid_molecule_residues(m, NULL);
    const ovoid_residue *const s = ovoid_molecule_residues(n, NULL);
    const size_t unit = ovoid_molecule_unit_atoms(m);
    bool same = unit == ovoid_molecule_unit_atoms(n) && !a == !b;
    for (size_t i = 0; same && a && i < unit; i++)
        same = strcmp(a[i].name, b[i].name) == 0 && strcmp(a[i].element, b[i].element) == 0 &&
               same_residue(&r[a[i].residue], &s[b[i].residue]);
    return same;
}

static bool same_radii(const double *xyzr, const double *other, size_t atoms) {
    bool same = xyzr && other;
    for (size_t i = 0; same && i < atoms; i++)
        same = xyzr[4 * i + 3] == other[4 * i + 3];
    return same;
}

static bool same_atoms(const ovoid_molecule *m, const ovoid_molecule *n) {
    const size_t atoms = ovoid_molecule_atoms(m);
    return atoms == ovoid_molecule_atoms(n) && same_identity(m, n) &&
           same_radii(ovoid_molecule_xyzr(m), ovoid_molecule_xyzr(n), atoms);
}

static ovoid_status move(const fit_job *job, ovoid_fitter *fitter) {
    const size_t atoms = ovoid_molecule_atoms(job->molecule);
    const double *const xyzr = ovoid_molecule_xyzr(job->molecule);
    double *const xyz = calloc(atoms, 3 * sizeof *xyz);
    if (!xyz || !xyzr) {
        free(xyz);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t i = 0; i < atoms; i++)
        memcpy(xyz + 3 * i, xyzr + 4 * i, 3 * sizeof *xyz);
    const ovoid_status status = ovoid_fitter_move(job->context, fitter, xyz);
    free(xyz);
    return status;
}

ovoid_status fit_session_join(fit_job *job) {
    fit_session *const session = job->session;
    if (session->fitter && same_atoms(session->molecule, job->molecule)) {
        const ovoid_status status = move(job, session->fitter);
        if (status != OVOID_OK)
            return status;
        job->fitter = session->fitter;
        session->fitter = NULL;
        job->moved_from = session->model;
        return OVOID_OK;
    }
    if (session->fitter && !job->quiet)
        cli_warning("its atoms or their radii are not those of model %d: it is fitted by itself",
                    (int)ovoid_molecule_model(session->molecule));
    fit_session_destroy(session);
    return ovoid_fitter_create(job->context, job->molecule, &job->options, &job->fitter);
}

void fit_session_remember(fit_job *job) {
    if (job->options.method == OVOID_METHOD_ADAPTIVE && job->levels_done > 1 &&
        ovoid_fitter_start_from(job->context, job->fitter, job->levels[0].model) != OVOID_OK)
        ovoid_fitter_destroy(&job->fitter); /* the next one begins with its atoms */
}

/* Parts are of atoms: a model that begins with another one is fitted as a whole, and would take
 * more memory than parts are there to save. */
static bool is_in_parts(const fit_job *job) {
    return job->levels_done && job->options.method == OVOID_METHOD_ADAPTIVE &&
           job->levels[0].result.parts > 1;
}

void fit_session_keep(fit_job *job) {
    fit_session *const session = job->session;
    if (is_in_parts(job))
        fit_session_destroy(session);
    if (!job->fitter || is_in_parts(job))
        return;
    ovoid_fitter_destroy(&session->fitter);
    ovoid_molecule_destroy(&session->molecule);
    session->fitter = job->fitter;
    session->molecule = job->molecule;
    session->model = job->levels_done ? job->number : job->moved_from;
    job->fitter = NULL;
    job->molecule = NULL;
}

void fit_session_destroy(fit_session *session) {
    ovoid_fitter_destroy(&session->fitter);
    ovoid_molecule_destroy(&session->molecule);
    session->model = 0;
}
