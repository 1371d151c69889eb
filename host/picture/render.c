#include "picture/render.h"

#include "base/progress.h"
#include "base/sized.h"
#include "model/fields.h"
#include "picture/colour_bar.h"
#include "picture/image.h"
#include "picture/radii.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const ov_lights ov_default_lights = {
    .key = {-0.42f, 0.58f, 0.698f, 0.82f},
    .fill = {0.72f, -0.1f, 0.687f, 0.2f},
    .ambient = 0.26f,
    .fade = 0.3f,
    .reach = 5.0f,
};

#define TAPS 72 /* places at which a pixel looks for neighbours that shade it */
#define FRAME_LEVEL                                                                                \
    0.4 /* of the isovalue: a sum of terms reaches further out than each of them                   \
         */
#define SHADE_GROUP 64
#define PANEL 3 /* pictures in a panel */

void ovoid_picture_options_init(ovoid_picture_options *options, size_t size) {
    static const ovoid_picture_options defaults = {
        .view = OVOID_VIEW_ORIGINAL,
        .width = 1200,
        .height = 900,
        .samples = 3,
        .centre = {NAN, NAN, NAN},
        .original = 0x5b9bd5ff,
        .model = 0xf2a64bff,
        .points = 0x1c3fd0ff,
        .background = 0xffffffff,
        .centres = true,
        .colour_bar = true,
    };
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

/* One field: its terms in the world (the field's own) and as the camera sees them, what rays meet.
 */
typedef struct scene {
    const ov_quadric *quadrics;
    ov_quadric *seen;
    size_t count, unit;
    ov_hits hits;
    bool traced;
} scene;

typedef struct painter {
    ovoid_context *context;
    const ovoid_picture_options *options;
    scene original, model;
    ov_camera camera;
    ov_rays rays;
    uint32_t width, height; /* of one picture */
    uint32_t reserve;       /* pixels at the right that are kept for the colour bar */
    double range;           /* of the difference */
    ov_colour diverging[OV_PALETTE_SIZE], distinct[OV_PALETTE_SIZE], radial[OV_PALETTE_SIZE];
    cl_uint palette_size;
    ov_tracer tracer;
    ov_kernel shade;
    ov_buffer palette, taps, pixels, cover;
} painter;

/* ---- what is asked ------------------------------------------------------------------------ */

static bool needs_original(ovoid_view view) {
    return view == OVOID_VIEW_ORIGINAL || view == OVOID_VIEW_OVERLAY ||
           view == OVOID_VIEW_DIFFERENCE || view == OVOID_VIEW_PANEL;
}

static bool needs_model(ovoid_view view) {
    return view != OVOID_VIEW_ORIGINAL;
}

/* Colours of a view that does not have them would be lost. */
static ovoid_status check_colouring(ovoid_context *context, const ovoid_picture_options *options) {
    const ovoid_view view = options->view;
    if ((unsigned)options->colouring > OVOID_PICTURE_BY_UNIT)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "there is no colouring %d of a picture",
                       (int)options->colouring);
    if (options->colouring == OVOID_PICTURE_BY_UNIT && view != OVOID_VIEW_ELLIPSOIDS)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "colours by unit are those of ellipsoids");
    if (options->colouring == OVOID_PICTURE_BY_RADIUS && view != OVOID_VIEW_ORIGINAL &&
        view != OVOID_VIEW_MODEL && view != OVOID_VIEW_ELLIPSOIDS)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "colours by radius are those of one surface, or of ellipsoids");
    return OVOID_OK;
}

static ovoid_status check_numbers(ovoid_context *context, const ovoid_picture_options *options) {
    for (int k = 0; k < 3; ++k)
        if (!isfinite(options->direction[k]) || !isfinite(options->rotation[k]))
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "a direction or a rotation of the view is not finite");
    if (!(options->isovalue > 0.0 && options->isovalue <= 1e6))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "isovalue %g is not above 0 and at most 1e6",
                       options->isovalue);
    if (!(options->across >= 0.0 && options->across <= 1e7))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%g angstrom across the picture are not within 0 to 1e7", options->across);
    if (!(options->range >= 0.0 && options->range <= 1e6))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a range of colours of %g angstrom is not within 0 to 1e6", options->range);
    return OVOID_OK;
}

static ovoid_status check(ovoid_context *context, const ovoid_field *original,
                          const ovoid_field *model, const ovoid_picture_options *options) {
    if ((unsigned)options->view > OVOID_VIEW_PANEL)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "there is no view %d", (int)options->view);
    if (needs_original(options->view) && !original)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_render: original is NULL: this view needs the original's field");
    if (needs_model(options->view) && !model)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_render: model is NULL: this view needs the model's field");
    const uint32_t least = options->view == OVOID_VIEW_PANEL ? PANEL : 1;
    if (options->width < least || options->height < 1 || options->width > OVOID_PICTURE_SIDE_MAX ||
        options->height > OVOID_PICTURE_SIDE_MAX)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a picture of %u by %u pixels is not within %u by 1 to %d by %d",
                       (unsigned)options->width, (unsigned)options->height, (unsigned)least,
                       OVOID_PICTURE_SIDE_MAX, OVOID_PICTURE_SIDE_MAX);
    if (options->samples < 1 || options->samples > OVOID_PICTURE_SAMPLES_MAX)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%u rays across a pixel are not within 1 to %d", (unsigned)options->samples,
                       OVOID_PICTURE_SAMPLES_MAX);
    const ovoid_status status = check_colouring(context, options);
    return status == OVOID_OK ? check_numbers(context, options) : status;
}

/* ---- the scene ---------------------------------------------------------------------------- */

static ovoid_status make_scene(ovoid_context *context, const ovoid_field *field, scene *s) {
    if (!field)
        return OVOID_OK;
    ovoid_status status = ov_field_check(context, field);
    if (status == OVOID_OK)
        status = ov_field_place(context, field);
    if (status != OVOID_OK)
        return status;
    s->quadrics = field->quadrics;
    s->count = field->count;
    s->unit = field->unit;
    s->seen = ov_alloc(context, field->count, sizeof *s->seen, "a picture's terms");
    return s->seen ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static void see(const ov_camera *camera, scene *s) {
    for (size_t i = 0; i < s->count; ++i)
        s->seen[i] = ov_camera_see(camera, &s->quadrics[i]);
}

static void widen(ov_extent *extent, const ov_extent *other) {
    for (int k = 0; k < 3; ++k) {
        extent->low[k] = fmin(extent->low[k], other->low[k]);
        extent->high[k] = fmax(extent->high[k], other->high[k]);
    }
}

/* Where there is something to see; where no term reaches the level, about all of them. */
static ov_extent extent_to_show(const painter *p, const scene *main) {
    const double c = p->options->isovalue;
    ov_extent extent = ov_extent_of(main->seen, main->count, FRAME_LEVEL * c);
    if (extent.low[0] > extent.high[0]) {
        double most = 0.0;
        for (size_t i = 0; i < main->count; ++i)
            most = fmax(most, main->seen[i].amplitude);
        extent = ov_extent_of(main->seen, main->count, FRAME_LEVEL * most);
    }
    if (p->options->view == OVOID_VIEW_ELLIPSOIDS) {
        const ov_extent single = ov_extent_of(p->model.seen, p->model.count, c);
        widen(&extent, &single);
    }
    return extent;
}

static void place_camera(painter *p) {
    const ovoid_picture_options *const o = p->options;
    const bool panel = o->view == OVOID_VIEW_PANEL;
    const scene *const main = p->original.count ? &p->original : &p->model;
    p->width = panel ? o->width / PANEL : o->width;
    p->height = o->height;
    if (o->view == OVOID_VIEW_DIFFERENCE && o->colour_bar)
        p->reserve = ov_colour_bar_width(p->width, p->height);
    ovoid_picture_options one = *o;
    one.width = p->width;
    ov_camera_aim(&p->camera, main->quadrics, main->count, &one);
    see(&p->camera, &p->original);
    see(&p->camera, &p->model);
    const ov_extent extent = extent_to_show(p, main);
    ov_camera_frame(&p->camera, &extent, p->width - p->reserve, p->height, &one);
    see(&p->camera, &p->original);
    see(&p->camera, &p->model);
    const double spacing = p->camera.pixel / o->samples;
    p->rays = (ov_rays){
        .columns = p->width * o->samples,
        .rows = p->height * o->samples,
        .left = -0.5 * (p->width - p->reserve) * p->camera.pixel + 0.5 * spacing,
        .top = 0.5 * p->height * p->camera.pixel - 0.5 * spacing,
        .spacing = spacing,
    };
}

/* ---- rays --------------------------------------------------------------------------------- */

static double cutoff_of(const painter *p) {
    return OV_PICTURE_CUTOFF * fmin(p->options->isovalue, 1.0);
}

static ovoid_status trace_surface(painter *p, scene *s) {
    ovoid_status status = OVOID_OK;
    ov_boxes boxes = {0};
    if (s->traced)
        return OVOID_OK;
    OV_TRY(ov_boxes_create(p->context, s->seen, s->count, cutoff_of(p), &p->rays, &boxes));
    OV_TRY(ov_trace(p->context, &p->tracer, &p->rays, &boxes, p->options->isovalue, &s->hits));
    OV_TRY(ov_finish(p->context)); /* before the boxes go */
    s->traced = true;
cleanup:
    ov_boxes_destroy(&boxes);
    return status;
}

static ovoid_status trace_ellipsoids(painter *p) {
    ovoid_status status = OVOID_OK;
    ov_boxes boxes = {0};
    OV_TRY(ov_boxes_create(p->context, p->model.seen, p->model.count, p->options->isovalue,
                           &p->rays, &boxes));
    OV_TRY(ov_trace_ellipsoids(p->context, &p->tracer, &p->rays, &boxes, &p->model.hits));
    OV_TRY(ov_finish(p->context));
cleanup:
    ov_boxes_destroy(&boxes);
    return status;
}

/* Least range of colours that holds 99 % of the distances that are seen. */
static double fitting_range(const ov_rays *rays, const float *depth, const float *distance) {
    enum { BINS = 4096 };
    uint64_t bins[BINS] = {0}, count = 0, within = 0;
    double most = 0.0;
    for (int pass = 0; pass < 2; ++pass)
        for (uint32_t row = 0; row < rays->rows; ++row)
            for (uint32_t column = 0; column < rays->columns; ++column) {
                const size_t at = ov_rays_index(rays, column, row);
                const double size = fabs((double)distance[at]);
                if (depth[at] <= OV_NOWHERE || !isfinite(size))
                    continue;
                if (pass == 0) {
                    most = fmax(most, size);
                    ++count;
                } else if (most > 0.0) {
                    ++bins[(int)(size / most * (BINS - 1))];
                }
            }
    for (int k = 0; k < BINS; ++k) {
        within += bins[k];
        if ((double)within >= 0.99 * (double)count)
            return ov_round_up(fmax(most * (k + 1) / BINS, 1e-3));
    }
    return 1.0;
}

static ovoid_status choose_range(painter *p) {
    ovoid_status status = OVOID_OK;
    const size_t count = ov_rays_packs(&p->rays) * OV_PACK;
    float *const depth = ov_alloc(p->context, count, sizeof *depth, "depths of rays");
    float *const distance = ov_alloc(p->context, count, sizeof *distance, "values of rays");
    if (!depth || !distance) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    const ov_hits *const hits = &p->original.hits;
    OV_TRY(ov_buffer_read(p->context, &hits->depth, 0, depth, count * sizeof *depth));
    OV_TRY(ov_buffer_read(p->context, &hits->extra, 0, distance, count * sizeof *distance));
    p->range = fitting_range(&p->rays, depth, distance);
cleanup:
    free(depth);
    free(distance);
    return status;
}

static ovoid_status measure_difference(painter *p) {
    ovoid_status status = OVOID_OK;
    ov_boxes boxes = {0};
    OV_TRY(
        ov_boxes_create(p->context, p->model.seen, p->model.count, cutoff_of(p), &p->rays, &boxes));
    OV_TRY(ov_compare(p->context, &p->tracer, &p->rays, &boxes, p->options->isovalue,
                      &p->original.hits));
    OV_TRY(ov_finish(p->context));
    p->range = p->options->range;
    if (!(p->range > 0.0))
        OV_TRY(choose_range(p));
cleanup:
    ov_boxes_destroy(&boxes);
    return status;
}

/* ---- light -------------------------------------------------------------------------------- */

/* How a pixel gets its colour. */
typedef enum paint { PAINT_PLAIN = 0, PAINT_DISTANCE, PAINT_INDEX } paint;

/* The colours that the shader looks up. */
static ovoid_status upload_palette(painter *p, const scene *base, paint by) {
    const bool by_unit = by == PAINT_INDEX && p->options->colouring == OVOID_PICTURE_BY_UNIT;
    const ov_colour *const own = by == PAINT_INDEX                                  ? p->distinct
                                 : p->options->colouring == OVOID_PICTURE_BY_RADIUS ? p->radial
                                                                                    : p->diverging;
    p->palette_size = by_unit ? (cl_uint)base->count : OV_PALETTE_SIZE;
    if (!by_unit)
        return ov_buffer_put(p->context, &p->palette, own, sizeof p->diverging, "colours");
    ov_colour *const each = ov_alloc(p->context, base->count, sizeof *each, "colours");
    if (!each)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < base->count; ++i)
        each[i] = p->distinct[i / base->unit % OV_PALETTE_SIZE];
    const ovoid_status status =
        ov_buffer_put(p->context, &p->palette, each, base->count * sizeof *each, "colours");
    free(each);
    return status;
}

/* A spiral that is denser in the middle, so that both narrow clefts and wide pockets are met. */
static ovoid_status upload_taps(painter *p) {
    float taps[2 * TAPS];
    for (int k = 0; k < TAPS; ++k) {
        const double radius = pow((k + 0.5) / TAPS, 0.75), angle = 2.399963229728653 * k;
        taps[2 * k] = (float)(radius * cos(angle));
        taps[2 * k + 1] = (float)(radius * sin(angle));
    }
    return ov_buffer_put(p->context, &p->taps, taps, sizeof taps, "light");
}

static cl_float4 to_float4(const float from[4]) {
    cl_float4 to;
    memcpy(&to, from, sizeof to);
    return to;
}

static cl_float4 linear_float4(uint32_t srgb) {
    return to_float4(ov_colour_linear(srgb).rgba);
}

/* What the distance fades to: the background, or white where there is none. */
static cl_float4 haze_of(const ovoid_picture_options *options) {
    const uint32_t opaque = options->background & 0xffu;
    return linear_float4(opaque ? options->background | 0xffu : 0xffffffffu);
}

static ovoid_status launch_shade(painter *p, const scene *base, paint by, const scene *pane,
                                 uint32_t colour) {
    const ov_lights *const lights = &ov_default_lights;
    const ov_hits *const hits = &base->hits, *const glass_hits = pane ? &pane->hits : hits;
    const float numbers[4] = {lights->ambient, (float)p->camera.near, (float)p->camera.far,
                              lights->fade};
    const cl_uint width = p->width, height = p->height, samples = p->options->samples;
    const cl_uint blocks = (cl_uint)ov_rays_blocks(&p->rays), how = (cl_uint)by;
    const cl_uint palette_size = p->palette_size, glass = pane != NULL, taps = TAPS;
    const cl_float spacing = (cl_float)p->rays.spacing;
    const cl_float range = (cl_float)(p->range > 0.0 ? p->range : 1.0), reach = lights->reach;
    const cl_float4 own = linear_float4(colour), tint = linear_float4(p->options->original);
    const cl_float4 background = linear_float4(p->options->background), haze = haze_of(p->options);
    const cl_float4 key = to_float4(lights->key), fill = to_float4(lights->fill);
    const cl_float4 ambient_near_far_fade = to_float4(numbers);
    return OV_LAUNCH(
        p->context, &p->shade, (size_t)width * height, SHADE_GROUP, OV_ARG(width), OV_ARG(height),
        OV_ARG(samples), OV_ARG(blocks), OV_ARG(spacing), OV_ARG(hits->depth.memory),
        OV_ARG(hits->normal.memory), OV_ARG(hits->extra.memory), OV_ARG(how),
        OV_ARG(p->palette.memory), OV_ARG(palette_size), OV_ARG(range), OV_ARG(glass),
        OV_ARG(glass_hits->depth.memory), OV_ARG(glass_hits->normal.memory), OV_ARG(own),
        OV_ARG(tint), OV_ARG(background), OV_ARG(haze), OV_ARG(key), OV_ARG(fill),
        OV_ARG(ambient_near_far_fade), OV_ARG(p->taps.memory), OV_ARG(taps), OV_ARG(reach),
        OV_ARG(p->pixels.memory), OV_ARG(p->cover.memory));
}

static ovoid_status count_covered(painter *p, ovoid_image *image) {
    const size_t count = (size_t)p->width * p->height;
    uint8_t *const cover = ov_alloc(p->context, count, 1, "the pixels of an image");
    if (!cover)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_buffer_read(p->context, &p->cover, 0, cover, count);
    for (size_t k = 0; status == OVOID_OK && k < count; ++k)
        image->covered += cover[k] > 0;
    free(cover);
    return status;
}

static ovoid_status shade(painter *p, const scene *base, paint by, const scene *pane,
                          uint32_t colour, ovoid_image *image) {
    ovoid_status status = OVOID_OK;
    const size_t count = (size_t)p->width * p->height;
    if (!p->shade.handle) {
        OV_TRY(ov_kernel_create(p->context, "render", "shade", &p->shade));
        OV_TRY(upload_taps(p));
        OV_TRY(ov_buffer_reserve(p->context, &p->pixels, 4 * count, "the pixels of an image"));
        OV_TRY(ov_buffer_reserve(p->context, &p->cover, count, "the pixels of an image"));
    }
    OV_TRY(upload_palette(p, base, by));
    OV_TRY(launch_shade(p, base, by, pane, colour));
    OV_TRY(ov_buffer_read(p->context, &p->pixels, 0, image->pixels, 4 * count));
    OV_TRY(count_covered(p, image));
cleanup:
    return status;
}

/* ---- marks -------------------------------------------------------------------------------- */

typedef struct mark {
    double z;
    size_t index;
} mark;

static int compare_marks(const void *a, const void *b) {
    const mark *const x = a, *const y = b;
    if (x->z != y->z)
        return x->z < y->z ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

/* Discs seen through everything, the far ones first and fainter. */
static ovoid_status draw_centres(painter *p, ovoid_image *image) {
    const scene *const s = &p->model;
    const double radius = fmax(1.2, 0.006 * fmin(p->width, p->height));
    const double deep = fmax(p->camera.near - p->camera.far, 1e-6);
    mark *const marks = ov_alloc(p->context, s->count, sizeof *marks, "centres of ellipsoids");
    if (!marks)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < s->count; ++i)
        marks[i] = (mark){s->seen[i].centre[2], i};
    qsort(marks, s->count, sizeof *marks, compare_marks);
    for (size_t k = 0; k < s->count; ++k) {
        const double *const centre = s->seen[marks[k].index].centre;
        const double x = 0.5 * (p->width - p->reserve) + centre[0] / p->camera.pixel;
        const double y = 0.5 * p->height - centre[1] / p->camera.pixel;
        const double share = fmin(fmax((p->camera.near - centre[2]) / deep, 0.0), 1.0);
        ov_colour rim = ov_colour_linear(0xffffffffu), ink = ov_colour_linear(p->options->points);
        rim.rgba[3] = (float)(0.85 - 0.65 * share);
        ink.rgba[3] = (float)(1.0 - 0.4 * share);
        ov_image_disc(image, x, y, 1.35 * radius, &rim);
        ov_image_disc(image, x, y, radius, &ink);
    }
    free(marks);
    return OVOID_OK;
}

static void draw_bar(painter *p, ovoid_image *image) {
    /* Dark on light and light on dark. */
    const ov_colour paper = ov_colour_linear(p->options->background);
    const float light = 0.2126f * paper.rgba[0] + 0.7152f * paper.rgba[1] + 0.0722f * paper.rgba[2];
    const bool dark = (p->options->background & 0xffu) && light < 0.18f;
    const ov_colour ink = ov_colour_linear(dark ? 0xe8e8e8ffu : 0x303030ffu);
    ov_colour_bar_draw(image, p->diverging, p->range, &ink);
}

/* ---- pictures ----------------------------------------------------------------------------- */

/* One scene by itself, by radius if that is asked for, else as it is painted without. */
static ovoid_status paint_alone(painter *p, scene *s, paint plain, uint32_t colour,
                                ovoid_image *image) {
    double middle[3];
    if (p->options->colouring != OVOID_PICTURE_BY_RADIUS)
        return shade(p, s, plain, NULL, colour, image);
    ov_middle_of(s->seen, s->count, middle);
    const ovoid_status status =
        ov_hits_by_radius(p->context, &p->rays, middle, &s->hits, image->radii);
    return status == OVOID_OK ? shade(p, s, PAINT_DISTANCE, NULL, colour, image) : status;
}

static ovoid_status paint_view(painter *p, ovoid_view view, bool centres, ovoid_image *image) {
    ovoid_status status = OVOID_OK;
    const ovoid_picture_options *const o = p->options;
    switch (view) {
    case OVOID_VIEW_ORIGINAL:
        OV_TRY(trace_surface(p, &p->original));
        OV_TRY(paint_alone(p, &p->original, PAINT_PLAIN, o->original, image));
        break;
    case OVOID_VIEW_MODEL:
        OV_TRY(trace_surface(p, &p->model));
        OV_TRY(paint_alone(p, &p->model, PAINT_PLAIN, o->model, image));
        break;
    case OVOID_VIEW_OVERLAY:
        OV_TRY(trace_surface(p, &p->original));
        OV_TRY(trace_surface(p, &p->model));
        OV_TRY(shade(p, &p->model, PAINT_PLAIN, &p->original, o->model, image));
        break;
    case OVOID_VIEW_DIFFERENCE:
        OV_TRY(trace_surface(p, &p->original));
        OV_TRY(measure_difference(p));
        OV_TRY(shade(p, &p->original, PAINT_DISTANCE, NULL, o->original, image));
        image->range = p->range;
        if (p->reserve)
            draw_bar(p, image);
        break;
    case OVOID_VIEW_ELLIPSOIDS:
        OV_TRY(trace_ellipsoids(p));
        OV_TRY(paint_alone(p, &p->model, PAINT_INDEX, o->model, image));
        break;
    case OVOID_VIEW_PANEL:
        break; /* is made of others */
    }
    if (centres)
        OV_TRY(draw_centres(p, image));
cleanup:
    return status;
}

static void fill_background(ovoid_image *image, uint32_t background) {
    for (size_t k = 0; k < (size_t)image->width * image->height; ++k)
        for (int channel = 0; channel < 4; ++channel)
            image->pixels[4 * k + (size_t)channel] = (uint8_t)(background >> (24 - 8 * channel));
}

static ovoid_status paint_panel(painter *p, ovoid_image *image) {
    static const ovoid_view views[PANEL] = {OVOID_VIEW_ORIGINAL, OVOID_VIEW_MODEL,
                                            OVOID_VIEW_OVERLAY};
    ovoid_status status = OVOID_OK;
    ovoid_image *one = NULL;
    fill_background(image, p->options->background);
    OV_TRY(ov_image_make(p->context, p->width, p->height, &one));
    for (uint32_t k = 0; k < PANEL; ++k) {
        OV_TRY(paint_view(p, views[k], views[k] == OVOID_VIEW_MODEL && p->options->centres, one));
        ov_image_place(image, k * p->width, 0, one);
    }
    image->covered = one->covered;
cleanup:
    ovoid_image_destroy(&one);
    return status;
}

static void destroy_scene(scene *s) {
    free(s->seen);
    ov_hits_destroy(&s->hits);
}

static void destroy_painter(painter *p) {
    destroy_scene(&p->original);
    destroy_scene(&p->model);
    ov_tracer_destroy(&p->tracer);
    ov_kernel_destroy(&p->shade);
    ov_buffer *const buffers[] = {&p->palette, &p->taps, &p->pixels, &p->cover};
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
}

ovoid_status ovoid_render(ovoid_context *context, ovoid_field *original, ovoid_field *model,
                          const ovoid_picture_options *options, ovoid_image **image) {
    OV_NEED(context, context);
    OV_NEED(context, options);
    OV_NEED(context, image);
    ovoid_picture_options o;
    ovoid_picture_options_init(&o, sizeof o);
    ovoid_status status = OV_SIZED_TAKE(context, ovoid_picture_options, options, &o);
    if (o.isovalue == 0.0)
        o.isovalue = ovoid_field_isovalue(original ? original : model);
    if (status == OVOID_OK)
        status = check(context, original, model, &o);
    if (status != OVOID_OK)
        return status;
    painter p = {.context = context, .options = &o};
    ovoid_image *made = NULL;
    ov_progress_begin(context, "render");
    const bool panel = o.view == OVOID_VIEW_PANEL;
    ov_palette_diverging(p.diverging);
    ov_palette_distinct(p.distinct);
    ov_palette_radial(p.radial);
    OV_TRY(make_scene(context, original, &p.original));
    OV_TRY(make_scene(context, model, &p.model));
    place_camera(&p);
    OV_TRY(ov_image_make(context, o.width, o.height, &made));
    if (panel)
        OV_TRY(paint_panel(&p, made));
    else
        OV_TRY(paint_view(
            &p, o.view,
            o.centres && (o.view == OVOID_VIEW_MODEL || o.view == OVOID_VIEW_ELLIPSOIDS), made));
    *image = made;
    made = NULL;
cleanup:
    ovoid_image_destroy(&made);
    destroy_painter(&p);
    ov_progress_end(context);
    return status;
}
