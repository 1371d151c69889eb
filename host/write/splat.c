/* glTF 2.0 with the extension KHR_gaussian_splatting (Khronos Group, ratified 2025), as JSON with
 * its buffer in base64: a primitive of points, each with a rotation (a quaternion x, y, z, w), a
 * scale (standard deviations along the axes), an opacity, and a colour as the coefficient of the
 * constant spherical harmonic. One unit is one angstrom; glTF's y axis is up, and coordinates are
 * those of the molecule all the same.
 *
 * The Gaussians are those of the field: the scale is 1 / sqrt(2 d). A sum of amplitudes becomes a
 * product of what is let through: the opacity is 1 - exp(-a) of the amplitude, times that of the
 * options. COLOR_0 is for programs that know points alone. */
#include "write/export.h"

#include "base/progress.h"
#include "write/base64.h"

#include <inttypes.h>
#include <math.h>

/* Of the constant spherical harmonic: 1 / (2 sqrt(pi)). */
#define CONSTANT_HARMONIC 0.28209479177387814

/* The attributes follow one another: position 3, rotation 4, scale 3, opacity 1, harmonic 3,
 * colour 4 floats. */
enum { ATTRIBUTES = 6 };
static const struct {
    const char *name, *type;
    int floats;
} attributes[ATTRIBUTES] = {{"POSITION", "VEC3", 3},
                            {"KHR_gaussian_splatting:ROTATION", "VEC4", 4},
                            {"KHR_gaussian_splatting:SCALE", "VEC3", 3},
                            {"KHR_gaussian_splatting:OPACITY", "SCALAR", 1},
                            {"KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", 3},
                            {"COLOR_0", "VEC4", 4}};

static double opacity_of(const ovoid_ellipsoid *e, const ov_drawing *drawing) {
    return drawing->opacity * -expm1(-e->amplitude);
}

/* Linear light of a part of a colour in sRGB. */
static double linear(double part) {
    return part <= 0.04045 ? part / 12.92 : pow((part + 0.055) / 1.055, 2.4);
}

static void values_of(const ovoid_ellipsoid *e, const ov_drawing *drawing, int attribute,
                      double value[4]) {
    ov_solid s;
    ov_solid_of_ellipsoid(e, drawing->isovalue, &s);
    if (attribute == 1)
        ov_solid_quaternion(&s, value);
    for (int k = 0; k < 3 && attribute != 1; k++)
        value[k] = attribute == 0   ? e->centre[k]
                   : attribute == 2 ? 1.0 / sqrt(2.0 * e->decay[k])
                   : attribute == 3 ? opacity_of(e, drawing)
                   : attribute == 4 ? (drawing->colour[k] - 0.5) / CONSTANT_HARMONIC
                                    : linear(drawing->colour[k]);
    if (attribute == 5)
        value[3] = opacity_of(e, drawing);
}

static ovoid_status put_buffer(ovoid_context *context, const ovoid_model *model,
                               const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t count = ovoid_model_size(model);
    ov_base64 b = {.stream = stream};
    for (int a = 0; a < ATTRIBUTES; a++)
        for (size_t i = 0; i < count && !ferror(stream); i++) {
            double value[4];
            OV_TRY(ov_progress_turn(context, i, count));
            values_of(ovoid_model_ellipsoids(model) + i, drawing, a, value);
            for (int k = 0; k < attributes[a].floats; k++)
                ov_base64_f32(&b, (float)value[k]);
        }
    ov_base64_end(&b);
cleanup:
    return status;
}

static void put_bounds(const ovoid_model *model, FILE *stream) {
    const ovoid_ellipsoid *const e = ovoid_model_ellipsoids(model);
    for (int top = 0; top < 2; top++) {
        fprintf(stream, ",\"%s\":[", top ? "max" : "min");
        for (int k = 0; k < 3; k++) {
            float found = (float)e[0].centre[k];
            for (size_t i = 1; i < ovoid_model_size(model); i++)
                found =
                    top ? fmaxf(found, (float)e[i].centre[k]) : fminf(found, (float)e[i].centre[k]);
            fprintf(stream, "%s%.9g", k ? "," : "", (double)found);
        }
        putc(']', stream);
    }
}

static void put_accessors(const ovoid_model *model, FILE *stream) {
    const size_t count = ovoid_model_size(model);
    uint64_t at = 0;
    fputs("\"accessors\":[", stream);
    for (int a = 0; a < ATTRIBUTES; a++) {
        fprintf(stream, "%s{\"bufferView\":%d,\"componentType\":5126,\"count\":%zu,\"type\":\"%s\"",
                a ? "," : "", a, count, attributes[a].type);
        if (a == 0)
            put_bounds(model, stream);
        putc('}', stream);
    }
    fputs("],\"bufferViews\":[", stream);
    for (int a = 0; a < ATTRIBUTES; a++) {
        const uint64_t bytes = (uint64_t)count * 4 * (uint64_t)attributes[a].floats;
        fprintf(stream,
                "%s{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64
                ",\"target\":34962}",
                a ? "," : "", at, bytes);
        at += bytes;
    }
    fprintf(stream,
            "],\"buffers\":[{\"byteLength\":%" PRIu64
            ",\"uri\":\"data:application/octet-stream;base64,",
            at);
}

ovoid_status ov_write_splat(ovoid_context *context, const ovoid_model *model,
                            const ov_drawing *drawing, FILE *stream) {
    fprintf(stream,
            "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Ovoid %s\","
            "\"extras\":{\"unit\":\"angstrom\"}},"
            "\"extensionsUsed\":[\"KHR_gaussian_splatting\"],"
            "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
            "\"nodes\":[{\"mesh\":0,\"name\":\"ellipsoids\"}],"
            "\"meshes\":[{\"name\":\"ellipsoids\",\"primitives\":[{\"mode\":0,\"attributes\":{",
            ovoid_version());
    for (int a = 0; a < ATTRIBUTES; a++)
        fprintf(stream, "%s\"%s\":%d", a ? "," : "", attributes[a].name, a);
    fputs("},\"extensions\":{\"KHR_gaussian_splatting\":{\"kernel\":\"ellipse\",\"colorSpace\":"
          "\"srgb_rec709_display\",\"projection\":\"perspective\",\"sortingMethod\":"
          "\"cameraDistance\"}}}]}],",
          stream);
    put_accessors(model, stream);
    const ovoid_status status = put_buffer(context, model, drawing, stream);
    fputs("\"}]}\n", stream);
    return status;
}
