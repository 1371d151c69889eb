#include "write/mesh_file.h"

#include "base/file.h"
#include "base/progress.h"
#include "write/text.h"

typedef struct format {
    const char *extension;
    ovoid_status (*write)(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
} format;

static const format formats[] = {{".ply", ov_write_ply},
                                 {".obj", ov_write_obj},
                                 {".stl", ov_write_stl},
                                 {".off", ov_write_off},
                                 {".glb", ov_write_glb}};

static const format *find_format(const char *path) {
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (ov_extension_is(ov_extension(path), formats[i].extension))
            return &formats[i];
    return NULL;
}

ovoid_status ovoid_mesh_write(ovoid_context *context, const ovoid_mesh *mesh, const char *path) {
    OV_NEED(context, context);
    OV_NEED(context, mesh);
    OV_NEED(context, path);
    const format *chosen = find_format(path);
    if (!chosen)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "'%s' does not say how to write a mesh: its name would end in .ply, .obj, "
                       ".stl, .off or .glb",
                       path);
    if (!ovoid_mesh_triangles(mesh))
        return ov_fail(context, OVOID_ERROR_EMPTY, "a mesh without triangles, not written to '%s'",
                       path);
    ovoid_status status = OVOID_OK;
    ov_output output = {0};
    ov_locale locale = {0};
    ov_progress_begin(context, "write");
    OV_TRY(ov_locale_enter(context, &locale));
    OV_TRY(ov_output_open(context, path, &output));
    OV_TRY(chosen->write(context, mesh, output.stream));
    OV_TRY(ov_stream_check(context, output.stream, path));
    status = ov_output_commit(context, &output);

cleanup:
    ov_output_abandon(&output);
    ov_locale_leave(&locale);
    ov_progress_end(context);
    return status;
}
