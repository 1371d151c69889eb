#include "picture/label.h"

#include <math.h>
#include <string.h>

/* A stroke is a part of an ellipse, or a line where turn is 0. Digits stand in a box 0.6 wide and 1
 * high; y runs down. */
typedef struct stroke {
    float x, y;   /* middle of the ellipse; beginning of the line */
    float rx, ry; /* its half axes; end of the line */
    float from;   /* in turns: 0 right, 1/4 down */
    float turn;   /* how far; 0 for a line */
} stroke;

enum { STROKES = 4 };

typedef struct glyph {
    char letter;
    float width;
    int count;
    stroke strokes[STROKES];
} glyph;

static const glyph glyphs[] = {
    {'0', 0.6f, 1, {{0.3f, 0.5f, 0.3f, 0.5f, 0.0f, 1.0f}}},
    {'1', 0.6f, 2, {{0.08f, 0.22f, 0.34f, 0.0f, 0, 0}, {0.34f, 0.0f, 0.34f, 1.0f, 0, 0}}},
    {'2',
     0.6f,
     3,
     {{0.3f, 0.29f, 0.28f, 0.29f, 0.5f, 0.62f},
      {0.505f, 0.487f, 0.02f, 1.0f, 0, 0},
      {0.02f, 1.0f, 0.6f, 1.0f, 0, 0}}},
    {'3',
     0.6f,
     2,
     {{0.28f, 0.25f, 0.26f, 0.25f, 0.55f, 0.7f}, {0.28f, 0.74f, 0.3f, 0.26f, 0.75f, 0.72f}}},
    {'4',
     0.6f,
     3,
     {{0.42f, 0.0f, 0.0f, 0.7f, 0, 0},
      {0.0f, 0.7f, 0.6f, 0.7f, 0, 0},
      {0.44f, 0.0f, 0.44f, 1.0f, 0, 0}}},
    {'5',
     0.6f,
     3,
     {{0.54f, 0.0f, 0.1f, 0.0f, 0, 0},
      {0.1f, 0.0f, 0.06f, 0.45f, 0, 0},
      {0.28f, 0.67f, 0.3f, 0.33f, 0.62f, 0.8f}}},
    {'6',
     0.6f,
     2,
     {{0.3f, 0.67f, 0.28f, 0.33f, 0.0f, 1.0f}, {0.66f, 0.67f, 0.64f, 0.67f, 0.5f, 0.2f}}},
    {'7', 0.6f, 2, {{0.0f, 0.0f, 0.58f, 0.0f, 0, 0}, {0.58f, 0.0f, 0.2f, 1.0f, 0, 0}}},
    {'8',
     0.6f,
     2,
     {{0.3f, 0.24f, 0.24f, 0.24f, 0.0f, 1.0f}, {0.3f, 0.74f, 0.29f, 0.26f, 0.0f, 1.0f}}},
    {'9',
     0.6f,
     2,
     {{0.3f, 0.33f, 0.28f, 0.33f, 0.0f, 1.0f}, {-0.06f, 0.33f, 0.64f, 0.67f, 0.0f, 0.2f}}},
    {'+', 0.6f, 2, {{0.05f, 0.55f, 0.55f, 0.55f, 0, 0}, {0.3f, 0.3f, 0.3f, 0.8f, 0, 0}}},
    {'-', 0.6f, 1, {{0.05f, 0.55f, 0.55f, 0.55f, 0, 0}}},
    {'.', 0.1f, 1, {{0.05f, 0.98f, 0.05f, 0.99f, 0, 0}}},
    {'e', 0.5f, 2, {{0.25f, 0.7f, 0.25f, 0.3f, 0.08f, 0.92f}, {0.0f, 0.7f, 0.5f, 0.7f, 0, 0}}},
    {'A',
     0.76f,
     4,
     {{0.38f, 0.06f, 0.0f, 1.0f, 0, 0},
      {0.38f, 0.06f, 0.76f, 1.0f, 0, 0},
      {0.14f, 0.67f, 0.62f, 0.67f, 0, 0},
      {0.38f, -0.13f, 0.09f, 0.09f, 0.0f, 1.0f}}},
};

#define GAP 0.26       /* between letters, of the height */
#define PEN 0.065      /* half the stroke's width, of the height */
#define PEN_LEAST 0.45 /* pixels */
#define PIECES 20      /* straight pieces of an ellipse */
#define TURN 6.283185307179586

static const glyph *find_glyph(char letter) {
    for (size_t i = 0; i < sizeof glyphs / sizeof glyphs[0]; ++i)
        if (glyphs[i].letter == letter)
            return &glyphs[i];
    return NULL;
}

static double distance_to_segment(double x, double y, const double a[2], const double b[2]) {
    const double dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
    double t = square > 0.0 ? ((x - a[0]) * dx + (y - a[1]) * dy) / square : 0.0;
    t = fmin(fmax(t, 0.0), 1.0);
    return hypot(x - a[0] - t * dx, y - a[1] - t * dy);
}

static void point_on(const stroke *s, int piece, double point[2]) {
    const double angle = TURN * (s->from + s->turn * piece / PIECES);
    point[0] = s->x + s->rx * cos(angle);
    point[1] = s->y + s->ry * sin(angle);
}

static double distance_to_stroke(const stroke *s, double x, double y) {
    double a[2] = {s->x, s->y}, b[2] = {s->rx, s->ry}, least = INFINITY;
    if (s->turn == 0.0f)
        return distance_to_segment(x, y, a, b);
    point_on(s, 0, a);
    for (int k = 1; k <= PIECES; ++k) {
        point_on(s, k, b);
        least = fmin(least, distance_to_segment(x, y, a, b));
        memcpy(a, b, sizeof a);
    }
    return least;
}

static void draw_glyph(ovoid_image *image, const glyph *g, double left, double top, double height,
                       const ov_colour *colour) {
    const double pen = fmax(PEN * height, PEN_LEAST), margin = 0.25 * height + pen + 1.0;
    const int64_t end_column = (int64_t)ceil(left + g->width * height + margin);
    const int64_t end_row = (int64_t)ceil(top + height + margin);
    for (int64_t row = (int64_t)floor(top - margin); row < end_row; ++row)
        for (int64_t column = (int64_t)floor(left - margin); column < end_column; ++column) {
            const double x = ((double)column + 0.5 - left) / height;
            const double y = ((double)row + 0.5 - top) / height;
            double least = INFINITY;
            for (int k = 0; k < g->count; ++k)
                least = fmin(least, distance_to_stroke(&g->strokes[k], x, y));
            ov_image_blend(image, column, row, colour, fmax(pen + 0.5 - least * height, 0.0));
        }
}

void ov_label_draw(ovoid_image *image, double x, double top, double height, const char *text,
                   const ov_colour *colour) {
    for (; *text; ++text) {
        const glyph *const g = find_glyph(*text);
        if (g)
            draw_glyph(image, g, x, top, height, colour);
        x += ((g ? g->width : 0.3) + GAP) * height;
    }
}

double ov_label_width(double height, const char *text) {
    double width = 0.0;
    for (const char *c = text; *c; ++c) {
        const glyph *const g = find_glyph(*c);
        width += (g ? g->width : 0.3) + GAP;
    }
    return text[0] ? (width - GAP) * height : 0.0;
}
