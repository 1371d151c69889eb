#include "write/png.h"

#include "base/file.h"
#include "base/progress.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

typedef struct writer {
    ovoid_context *context;
    FILE *stream;
    ovoid_status status; /* of what stopped the writing, if not libpng */
    char error[128];     /* libpng's message */
    uint8_t *row;        /* RGB of one row, NULL for RGBA */
} writer;

/* A failed write is left to the stream, which remembers it: going on costs nothing but time. */
static void on_write(png_structp png, png_bytep data, size_t bytes) {
    const writer *const w = png_get_io_ptr(png);
    (void)!fwrite(data, 1, bytes, w->stream);
}

static void on_flush(png_structp png) {
    (void)png; /* ov_output_commit() does */
}

static void on_error(png_structp png, png_const_charp message) {
    writer *const w = png_get_error_ptr(png);
    snprintf(w->error, sizeof w->error, "%s", message);
    longjmp(png_jmpbuf(png), 1);
}

static void on_warning(png_structp png, png_const_charp message) {
    (void)png;
    (void)message;
}

static bool is_opaque(const ovoid_image *image) {
    const size_t count = (size_t)image->width * image->height;
    for (size_t k = 0; k < count; ++k)
        if (image->pixels[4 * k + 3] != 255)
            return false;
    return true;
}

static const uint8_t *row_of(const ovoid_image *image, const writer *w, uint32_t y) {
    const uint8_t *const from = image->pixels + (size_t)4 * y * image->width;
    if (!w->row)
        return from;
    for (size_t x = 0; x < image->width; ++x)
        memcpy(w->row + 3 * x, from + 4 * x, 3);
    return w->row;
}

/* Nothing here may live in a local variable across libpng's long jumps. */
static bool write_all(png_structp png, png_infop info, const ovoid_image *image, writer *w) {
    if (setjmp(png_jmpbuf(png)))
        return false;
    png_set_IHDR(png, info, image->width, image->height, 8,
                 w->row ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_set_compression_level(png, 7);
    png_write_info(png, info);
    for (uint32_t y = 0; y < image->height; ++y) {
        w->status = ov_progress_step(w->context, y, image->height);
        if (w->status != OVOID_OK)
            return false;
        png_write_row(png, row_of(image, w, y));
    }
    png_write_end(png, info);
    return true;
}

ovoid_status ov_png_write(ovoid_context *context, const ovoid_image *image, FILE *stream) {
    ovoid_status status = OVOID_OK;
    writer w = {.context = context, .stream = stream};
    png_structp png = NULL;
    png_infop info = NULL;
    if (is_opaque(image)) {
        w.row = ov_alloc(context, image->width, 3, "a row of pixels");
        if (!w.row)
            return OVOID_ERROR_MEMORY;
    }
    png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &w, on_error, on_warning);
    info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        status = ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a PNG file");
        goto cleanup;
    }
    png_set_write_fn(png, &w, on_write, on_flush);
    if (!write_all(png, info, image, &w))
        status = w.status != OVOID_OK ? w.status
                                      : ov_fail(context, OVOID_ERROR_MEMORY, "libpng: %s", w.error);
cleanup:
    png_destroy_write_struct(&png, &info);
    free(w.row);
    return status;
}

ovoid_status ovoid_image_write(ovoid_context *context, const ovoid_image *image, const char *path) {
    OV_NEED(context, context);
    OV_NEED(context, image);
    OV_NEED(context, path);
    ovoid_status status = OVOID_OK;
    ov_output output = {0};
    ov_progress_begin(context, "write");
    OV_TRY(ov_output_open(context, path, &output));
    OV_TRY(ov_png_write(context, image, output.stream));
    status = ov_output_commit(context, &output); /* reports a failed write too */
cleanup:
    ov_output_abandon(&output);
    ov_progress_end(context);
    return status;
}
