/*
 * What the subcommands share: exit codes, messages, options, signals. The tool uses nothing of the
 * library but its public header.
 */
#ifndef CLI_H
#define CLI_H

#include "ovoid/ovoid.h"

#include <cJSON.h>
#include <getopt.h>
#include <stdio.h>

/* Exit codes, documented in --help. A signal that ended the work gives 128 + its number. */
enum {
    CLI_OK = 0,
    CLI_INTERNAL = 1, /* OpenCL or the program itself failed */
    CLI_USAGE = 2,    /* unknown or bad options */
    CLI_INPUT = 3,    /* an input cannot be read or makes no sense */
    CLI_OUTPUT = 4,   /* an output cannot be written */
    CLI_DEVICE = 5,   /* no OpenCL device, none that matches, or one that computes wrongly */
    CLI_COMPUTE = 6,  /* out of memory, over a limit, or numbers that are not finite */
    CLI_GOAL = 7,     /* all went well, but what a fit reached is not what was asked */
    CLI_SOME = 8,     /* of several inputs some failed */
    CLI_NONE = 9,     /* all of them did, not all for the same reason */
    CLI_TIME = 10     /* a time limit ended a fit before any model held */
};

/* ---- main.c: messages ----------------------------------------------------------------------- */

/* "ovoid: error: ..." and "ovoid: warning: ..." on standard error, erasing the progress line. */
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
void
cli_error(const char *format, ...);
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
void
cli_warning(const char *format, ...);

/* What is worth knowing and no cause to worry. */
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
void
cli_note(const char *format, ...);

/* From now on errors and warnings that do not name `about` begin with it; NULL: with nothing. The
 * text must live until replaced. Forgets the last error. */
void cli_message_subject(const char *about);
/* From now on all of them say who says so, such as "rank 2"; the text must live. */
void cli_message_speaker(const char *who);
/* The text of the last error since then, "" for none. Valid until the next. */
const char *cli_last_error(void);

/* An ovoid_warning_fn; user is a bool: quiet. */
void cli_on_warning(const char *text, void *quiet);

/* Makes a context whose warnings are printed unless *quiet, whose work shows its progress, unless
 * *quiet, where it takes long, and which a signal stops. False: *code is the exit code, all said.
 */
bool cli_context(bool *quiet, ovoid_context **context, int *code);

/* Reports the context's error, unless a signal is behind it, and returns the exit code for
 * `status`; `io` is the one for OVOID_ERROR_IO: CLI_INPUT or CLI_OUTPUT. */
int cli_failure(const ovoid_context *context, ovoid_status status, int io);

/* The options that all who compute have. */
#define CLI_HELP_RUNNING                                                                           \
    "  --device SELECTOR   number, type (cpu, gpu), PCI address, UUID or part of the name of a\n"  \
    "                      device that 'ovoid devices' lists (default: OVOID_DEVICE, else the\n"   \
    "                      first GPU, else the first device)\n"                                    \
    "  -q, --quiet         print errors only\n"                                                    \
    "  -h, --help          show this help\n"

/* The exit codes and environment variables, as the helps show them. */
void cli_print_exit_codes(FILE *stream);
void cli_print_environment(FILE *stream);

/* ---- device.c ------------------------------------------------------------------------------- */

/* Opens the device for work that takes one: of several that the selector names it is the first, and
 * a warning says so unless quiet. */
ovoid_status cli_open_device(ovoid_context *context, const char *selector, bool quiet);
/* A line of the summary for each that was named, or for the first alone. */
void cli_print_device(const ovoid_context *context, FILE *out);
void cli_print_devices(const ovoid_context *context, FILE *out);

/* Seconds of a monotonic clock. */
double cli_seconds(void);

/* Whether two paths lead to the same file, one that need not exist yet. */
bool cli_same_file(const char *a, const char *b);

/* ---- options.c ------------------------------------------------------------------------------ */

/* A number that an option sets, in a structure of defaults. */
typedef enum cli_kind { CLI_REAL, CLI_COUNT } cli_kind;
typedef struct cli_number {
    const char *name;  /* of the option, without the dashes */
    cli_kind kind;     /* double or uint32_t */
    size_t offset;     /* in the structure */
    double low, high;  /* smallest and largest value */
    bool above, below; /* low, high themselves are not allowed */
    const char *unit;  /* "" for a pure number */
    const char *help;
} cli_number;

/* Reads `text` into structure according to the number's kind and range; reports a usage error and
 * returns false if it does not fit. */
bool cli_number_parse(const cli_number *number, const char *text, void *structure);

/* A help entry: the option with its value's name ("--method NAME"), and its meaning. "(default "
 * and what follows stays together. */
void cli_option_help(const char *option, const char *meaning, FILE *stream);

/* A help entry: name, meaning, and the value in the structure as the default; a structure of NULL
 * says that there is none, or that the meaning names it. */
void cli_number_help(const cli_number *number, const void *structure, FILE *stream);

double cli_number_value(const cli_number *number, const void *structure);

/* Long options for numbers, of the values first, first + 1 and so on, and behind them the end of
 * the table: count + 1 entries. */
void cli_number_options(const cli_number *numbers, size_t count, int first, struct option *options);

/* Explains what getopt_long() did not like about the option it has just met ('?' or ':', with an
 * option string that begins with ':' and values above 255 for long options) and returns CLI_USAGE.
 */
int cli_bad_option(const char *command, int result, char **argv, const struct option *options);

/* The name among `names` (NULL at the end) nearest to `text`, NULL if none is near. */
const char *cli_nearest(const char *text, const char *const *names);

/* ---- interrupt.c ---------------------------------------------------------------------------- */

/* From now on SIGINT, SIGTERM and SIGHUP stop the work: the library's functions end with
 * OVOID_ERROR_CANCELLED. What has not ended a moment later, well within a second, ends with the
 * program, as it does at a second signal; no temporary file stays. The exit code is 128 + the
 * signal's number. Signals ignored by whoever started the program stay ignored. A closed pipe and a
 * file over the size limit become write errors. */
void cli_catch_signals(void);

/* The same again: the compiler of a driver (LLVM in PoCL) puts handlers of its own in their place,
 * also of ignored signals, and where those are called a write that waits fails. To be called after
 * kernels may have been compiled. */
void cli_keep_signals(void);

/* Number of the signal that came, 0 for none. */
int cli_interrupted(void);

/* Says that the work was interrupted, once. */
void cli_tell_interrupted(void);

/* From now on that is for others to say. */
void cli_hush_interrupted(void);

/* Whether from now on work that asks is not stopped any more: what is left is short, and better
 * whole. */
void cli_finish_in_any_case(bool on);

/* From now on the context's work shows its progress, unless quiet, and is stopped by a signal. */
void cli_watch(ovoid_context *context, bool quiet);

/* An ovoid_progress_fn without a user: what cli_watch() does at each call. */
bool cli_on_progress(const ovoid_progress *progress, void *user);

/* ---- progress.c ----------------------------------------------------------------------------- */

/* Shows the state of the work in one line of standard error if that is a terminal. `label` begins
 * the line and must outlive it; NULL for none. The first state after a start and the first of each
 * stage are drawn at once, those between at most every tenth of a second of cli_seconds(). What is
 * no fit is mostly done at once: of it nothing is drawn in the first half second. */
void cli_progress_start(bool quiet, const char *label);
void cli_progress_show(const ovoid_progress *progress);
void cli_progress_erase(void);

/* Whole seconds as text: "1 h 05 min", "2 min 07 s", "9 s". */
void cli_print_duration(double seconds, char *text, size_t size);

/* ---- json.c --------------------------------------------------------------------------------- */

/* As their namesakes of cJSON, but text that is not UTF-8 (a file name may be anything) is made so.
 */
bool cli_json_string(cJSON *object, const char *key, const char *text);

/* Writes the JSON text and a line end whole or not at all. */
ovoid_status cli_json_write(ovoid_context *context, const cJSON *json, const char *path);

/* ---- input.c -------------------------------------------------------------------------------- */

/* Whether a file is a model rather than a molecule: by its extension, else by how it begins.
 * Standard input counts as a model. */
bool cli_is_model(const char *path);

/* ---- profile.c ------------------------------------------------------------------------------ */

/* Where the time of some work went. {0}, less wanted, is one that does nothing. */
typedef struct cli_profile {
    bool wanted;              /* --profile */
    double began, seconds;    /* of the work, by the host's clock */
    ovoid_kernel_time *times; /* owned */
    size_t count;
    uint64_t counts[OVOID_COUNTS]; /* by ovoid_count: before the work, then what it made of them */
    bool known;                    /* the work is done, and times hold what it launched */
} cli_profile;

#define CLI_HELP_PROFILE "print which kernels took the device's time"

/* Around the work, with the device opened. */
ovoid_status cli_profile_begin(cli_profile *profile, ovoid_context *context);
ovoid_status cli_profile_end(cli_profile *profile, ovoid_context *context);
void cli_profile_destroy(cli_profile *profile);

/* A blank line, a table, with a row per kernel, all else, and the whole work under its name, and a
 * line of what passed between host and device. Nothing unless known. */
void cli_profile_print(const cli_profile *profile, const char *whole, FILE *out);

/* The same as `kernels`: an array of objects with name, launches, seconds and share of the whole;
 * null for what the driver does not tell. Nothing unless known. */
bool cli_profile_report(const cli_profile *profile, cJSON *report);

/* Adds what was counted at the device, under the names of ovoid_count. counts: by
 * ovoid_count. */
bool cli_counts_report(const uint64_t counts[OVOID_COUNTS], cJSON *object);

/* ---- subcommands ---------------------------------------------------------------------------- */

int cli_fit(int argc, char **argv);
int cli_mesh(int argc, char **argv);
int cli_measure(int argc, char **argv);
int cli_render(int argc, char **argv);
int cli_devices(int argc, char **argv);
int cli_selftest(int argc, char **argv);
int cli_export(int argc, char **argv);

void cli_fit_help(FILE *stream);
void cli_mesh_help(FILE *stream);
void cli_measure_help(FILE *stream);
void cli_render_help(FILE *stream);
void cli_devices_help(FILE *stream);
void cli_selftest_help(FILE *stream);
void cli_export_help(FILE *stream);

#endif
