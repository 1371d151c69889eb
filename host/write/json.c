/* A model as JSON (RFC 8259), written as it goes: a tree of it would be many times its size. */
#include "write/export.h"

#include "base/progress.h"
#include "write/text.h"

static void write_vector(const char *key, const double *v, FILE *stream) {
    fprintf(stream, "\"%s\": [%.9g, %.9g, %.9g]", key, v[0], v[1], v[2]);
}

static void write_ellipsoid(const ovoid_ellipsoid *e, double isovalue, FILE *stream) {
    ov_solid s;
    ov_solid_of_ellipsoid(e, isovalue, &s);
    fprintf(stream, "    {\"amplitude\": %.9g, ", e->amplitude);
    write_vector("decay", e->decay, stream);
    fputs(", ", stream);
    write_vector("centre", e->centre, stream);
    fputs(", ", stream);
    write_vector("angle", e->angle, stream);
    fputs(",\n     \"axes\": [", stream);
    for (int p = 0; p < 3; p++)
        fprintf(stream, "%s[%.9g, %.9g, %.9g]", p ? ", " : "", s.axis[p][0], s.axis[p][1],
                s.axis[p][2]);
    fputs("], ", stream);
    write_vector("semi_axes", s.semi, stream);
    fprintf(stream, ", \"reaches_isovalue\": %s}", e->amplitude > isovalue ? "true" : "false");
}

ovoid_status ov_write_json(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_ellipsoid *ellipsoids = ovoid_model_ellipsoids(model);
    const char *note;
    fprintf(stream,
            "{\n"
            "  \"format\": \"ovoid model\",\n"
            "  \"version\": 1,\n"
            "  \"program\": \"ovoid %s\",\n"
            "  \"decay\": %.9g,\n"
            "  \"isovalue\": %.9g,\n"
            "  \"semi_axes_isovalue\": %.9g,\n"
            "  \"notes\": [",
            ovoid_version(), ovoid_model_decay(model), ovoid_model_isovalue(model),
            drawing->isovalue);
    for (size_t i = 0; (note = ovoid_model_note(model, i)) != NULL && !ferror(stream); i++) {
        fputs(i ? ",\n    " : "\n    ", stream);
        ov_json_string(note, stream);
    }
    fputs(ovoid_model_note(model, 0) ? "\n  ],\n" : "],\n", stream);
    fputs("  \"ellipsoids\": [\n", stream);
    for (size_t i = 0; i < ovoid_model_size(model) && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, ovoid_model_size(model)));
        if (i)
            fputs(",\n", stream);
        write_ellipsoid(&ellipsoids[i], drawing->isovalue, stream);
    }
    fputs("\n  ]\n}\n", stream);
cleanup:
    return status;
}
