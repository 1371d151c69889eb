#include "cli.h"
#include "forecast.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { WIDTH_UNKNOWN = 80, WIDTH_MOST = 100, BAR = 20 };
enum { STAGE_LENGTH = 32 };
static const double redraw_seconds = 0.1, quick_seconds = 0.5;

static struct {
    bool enabled;
    bool shown;               /* the line is on the screen */
    char stage[STAGE_LENGTH]; /* the stage that the line names */
    double drawn;             /* when, in cli_seconds() */
    double pace;              /* smoothed seconds per iteration, 0 before it is known */
    double at_seconds;        /* where the pace was last measured */
    uint64_t at_iteration;
    const char *label;
    cli_forecast forecast; /* of a fit in parts */
} line;

void cli_progress_start(bool quiet, const char *label) {
    const char *terminal = getenv("TERM");
    memset(&line, 0, sizeof line);
    line.label = label;
    line.enabled =
        !quiet && isatty(STDERR_FILENO) && terminal && terminal[0] && strcmp(terminal, "dumb") != 0;
}

void cli_progress_erase(void) {
    if (!line.shown)
        return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    line.shown = false;
}

static size_t terminal_width(void) {
    struct winsize size;
    size_t width = WIDTH_UNKNOWN;
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
        width = size.ws_col;
    return width < WIDTH_MOST ? width : WIDTH_MOST;
}

/* Follows the time of an iteration, which falls as ellipsoids go. The first iteration of a stage
 * also holds what prepares it: measuring begins after it. */
static void measure_pace(const ovoid_progress *progress, bool new_stage) {
    if (!new_stage) {
        const double spent = progress->seconds - line.at_seconds;
        if (progress->iteration <= line.at_iteration || spent <= 0.0)
            return;
        const double now = spent / (double)(progress->iteration - line.at_iteration);
        line.pace = line.pace > 0.0 ? 0.8 * line.pace + 0.2 * now : now;
    }
    line.at_iteration = progress->iteration;
    line.at_seconds = progress->seconds;
}

void cli_print_duration(double seconds, char *text, size_t size) {
    unsigned long s = (unsigned long)fmin(ceil(seconds), 1e8);
    if (s >= 3600)
        snprintf(text, size, "%lu h %02lu min", s / 3600, s / 60 % 60);
    else if (s >= 60)
        snprintf(text, size, "%lu min %02lu s", s / 60, s % 60);
    else
        snprintf(text, size, "%lu s", s);
}

/* Appends a part to the line if all of it fits. */
static void append(char *text, size_t width, const char *part) {
    size_t used = strlen(text), gap = used ? 2 : 0;
    if (used + gap + strlen(part) > width)
        return;
    memset(text + used, ' ', gap);
    strcpy(text + used + gap, part);
}

static void append_count(char *text, size_t width, uint64_t number, const char *what) {
    char part[96];
    snprintf(part, sizeof part, "%llu %s", (unsigned long long)number, what);
    append(text, width, part);
}

/* Nobody knows how many steps there will be, or none has been done: what is done, and for how long
 * it has gone on. */
static void compose_endless(const ovoid_progress *progress, char *text, size_t width) {
    char part[96];
    if (progress->total != OVOID_UNKNOWN && progress->total > 1) { /* of a molecule in parts */
        snprintf(part, sizeof part, "%llu/%llu parts", (unsigned long long)progress->done,
                 (unsigned long long)progress->total);
        append(text, width, part);
    }
    const double left = cli_forecast_left(&line.forecast, progress, 1);
    if (left > 0.0) {
        char duration[64];
        cli_print_duration(left, duration, sizeof duration);
        snprintf(part, sizeof part, "%s left", duration);
        append(text, width, part);
    }
    if (progress->iteration > 0) {
        snprintf(part, sizeof part, "step %llu", (unsigned long long)progress->iteration);
        append(text, width, part);
    }
    if (strcmp(progress->stage, "sample") == 0)
        append_count(text, width, progress->points, "points");
    else
        append_count(text, width, progress->ellipsoids, "ellipsoids");
    cli_print_duration(floor(progress->seconds), part, sizeof part);
    append(text, width, part);
}

/* Of what is no fit: the share of this stage that is done, and for how long all has gone on. */
static void compose_other(const ovoid_progress *progress, char *text, size_t width) {
    char part[96];
    if (progress->total != OVOID_UNKNOWN) {
        const double share = (double)progress->done / (double)progress->total;
        snprintf(part, sizeof part, "%.0f %%", floor(100.0 * fmin(share, 1.0)));
        append(text, width, part);
    }
    cli_print_duration(floor(progress->seconds), part, sizeof part);
    append(text, width, part);
}

static bool is_fit(const ovoid_progress *progress) {
    return progress->method != OVOID_NO_METHOD;
}

/* Towards a known number of iterations. */
static void compose_bounded(const ovoid_progress *progress, char *text, size_t width) {
    char part[96];
    double share = (double)progress->iteration / (double)progress->iterations;
    snprintf(part, sizeof part, "%llu/%llu", (unsigned long long)progress->iteration,
             (unsigned long long)progress->iterations);
    append(text, width, part);
    append_count(text, width, progress->ellipsoids, "ellipsoids");
    snprintf(part, sizeof part, "error %.3f", progress->l1.max_error);
    append(text, width, part);
    if (line.pace > 0.0) {
        double left = line.pace * (double)(progress->iterations - progress->iteration);
        char duration[64];
        cli_print_duration(left, duration, sizeof duration);
        snprintf(part, sizeof part, "%s left", duration);
        append(text, width, part);
    }
    int filled = (int)(share * BAR);
    snprintf(part, sizeof part, "[%.*s%.*s]", filled, "####################", BAR - filled,
             "....................");
    append(text, width, part);
}

/* The parts in the order of their importance, as many as the terminal is wide enough for. */
static void compose(const ovoid_progress *progress, char *text, size_t width) {
    text[0] = '\0';
    if (line.label)
        append(text, width, line.label);
    append(text, width, progress->stage);
    if (!is_fit(progress))
        compose_other(progress, text, width);
    else if (progress->iterations == OVOID_UNKNOWN || progress->iteration == 0)
        compose_endless(progress, text, width);
    else
        compose_bounded(progress, text, width);
}

/* A new stage at once, however short the one before it was: what the screen names is what is under
 * way. Within a stage as often as eyes can follow. */
void cli_progress_show(const ovoid_progress *progress) {
    if (!line.enabled || (!is_fit(progress) && progress->seconds < quick_seconds))
        return;
    const double now = cli_seconds();
    const bool new_stage = strncmp(line.stage, progress->stage, STAGE_LENGTH - 1) != 0;
    if (line.shown && !new_stage && now - line.drawn < redraw_seconds)
        return;
    measure_pace(progress, new_stage);
    char text[WIDTH_MOST + 1];
    compose(progress, text, terminal_width() - 1); /* the last column would wrap */
    fprintf(stderr, "\r%s\033[K", text);
    fflush(stderr);
    line.shown = true;
    line.drawn = now;
    snprintf(line.stage, sizeof line.stage, "%s", progress->stage);
}
