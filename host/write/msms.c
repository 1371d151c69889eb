/* The files of MSMS (M. Sanner, its manual, "Output files"): NAME.vert with a vertex per line, its
 * normal, the number of an analytic face, which is 0 here, that of the nearest atom, from 1, and a
 * type; NAME.face with the vertices of a triangle, from 1, a type, and again a face. Three lines
 * come first, and say how many there are, with the density of vertices and a probe, which is none.
 */
#include "write/paint.h"

#include "base/file.h"
#include "base/progress.h"
#include "write/mesh_file.h"
#include "write/text.h"

#include <stdlib.h>
#include <string.h>

/* Types: of a vertex within a face of contact, and of such a face. */
enum { WITHIN = 2, CONTACT = 3 };

static void put_head(const ovoid_mesh *mesh, const char *what, size_t count, size_t atoms,
                     const char *title, FILE *stream) {
    fprintf(stream, "# Ovoid %s: Gaussian surface, %s of ", ovoid_version(), what);
    for (; *title; title++)
        putc((unsigned char)*title < 0x20 ? ' ' : *title, stream);
    fprintf(stream, "\n#%s #sphere density probe_r\n%7zu %7zu %6.2f %6.2f\n", what, count, atoms,
            (double)ovoid_mesh_vertices(mesh) / ovoid_mesh_area(mesh), 0.0);
}

static ovoid_status put_vertices(ovoid_context *context, const ov_painted *p, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t count = ovoid_mesh_vertices(p->mesh);
    const int digits = ov_mesh_digits(p->mesh);
    for (size_t v = 0; v < count && !ferror(stream); v++) {
        const double *const x = ovoid_mesh_xyz(p->mesh) + 3 * v;
        const float *const n = ovoid_mesh_normals(p->mesh) + 3 * v;
        OV_TRY(ov_progress_turn(context, v, count));
        fprintf(stream, "%9.*g %9.*g %9.*g %9.6f %9.6f %9.6f %7d %7lu %2d\n", digits, x[0], digits,
                x[1], digits, x[2], (double)n[0], (double)n[1], (double)n[2], 0,
                (unsigned long)p->atom[v] + 1, WITHIN);
    }
cleanup:
    return status;
}

static ovoid_status put_faces(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t count = ovoid_mesh_triangles(mesh);
    const uint32_t *const corners = ovoid_mesh_corners(mesh);
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, count));
        fprintf(stream, "%6lu %6lu %6lu %2d %6d\n", (unsigned long)corners[3 * i] + 1,
                (unsigned long)corners[3 * i + 1] + 1, (unsigned long)corners[3 * i + 2] + 1,
                CONTACT, 0);
    }
cleanup:
    return status;
}

/* Both files are there in full before either takes its name. */
static ovoid_status put_both(ovoid_context *context, const ov_painted *p, size_t atoms,
                             const char *title, const char *path, const char *beside) {
    ovoid_status status = OVOID_OK;
    ov_output vertices = {0}, faces = {0};
    OV_TRY(ov_output_open(context, path, &vertices));
    OV_TRY(ov_output_open(context, beside, &faces));
    put_head(p->mesh, "vertex", ovoid_mesh_vertices(p->mesh), atoms, title, vertices.stream);
    OV_TRY(put_vertices(context, p, vertices.stream));
    OV_TRY(ov_stream_check(context, vertices.stream, path));
    put_head(p->mesh, "faces", ovoid_mesh_triangles(p->mesh), atoms, title, faces.stream);
    OV_TRY(put_faces(context, p->mesh, faces.stream));
    OV_TRY(ov_stream_check(context, faces.stream, beside));
    OV_TRY(ov_output_commit(context, &faces));
    status = ov_output_commit(context, &vertices);
cleanup:
    ov_output_abandon(&vertices);
    ov_output_abandon(&faces);
    return status;
}

static ovoid_status check(ovoid_context *context, const ov_scene *scene, const char *path) {
    if (!ov_extension_is(ov_extension(path), ".vert"))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "MSMS's files are two, NAME.vert and NAME.face: give the name of the first "
                       "instead of '%s'",
                       path);
    if (!scene->molecule)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "MSMS's files name the nearest atom of each vertex: they take a molecule");
    return OVOID_OK;
}

ovoid_status ov_write_msms(ovoid_context *context, const ov_scene *scene,
                           const ovoid_export_options *options, const char *title,
                           const char *path) {
    ovoid_export_options plain = *options;
    ovoid_status status = OVOID_OK;
    ov_painted painted = {0};
    ov_locale locale = {0};
    const size_t length = strlen(path);
    char *const beside = ov_alloc(context, length + 1, 1, "the name of a file");
    if (!beside)
        return OVOID_ERROR_MEMORY;
    ov_progress_begin(context, "mesh");
    OV_TRY(check(context, scene, path));
    memcpy(beside, path, length - strlen(".vert"));
    strcpy(beside + length - strlen(".vert"), ".face");
    plain.colouring = OVOID_COLOUR_PLAIN;
    OV_TRY(ov_paint(context, scene, &plain, true, &painted));
    (void)ov_progress_stage(context, "write");
    OV_TRY(ov_locale_enter(context, &locale));
    status =
        put_both(context, &painted, ovoid_molecule_atoms(scene->molecule), title, path, beside);
cleanup:
    ov_locale_leave(&locale);
    ov_painted_drop(&painted);
    ov_progress_end(context);
    free(beside);
    return status;
}
