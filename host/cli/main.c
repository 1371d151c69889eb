#include "cli.h"
#include "ranks.h"

#include <errno.h>
#include <fcntl.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

typedef struct subcommand {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
    void (*help)(FILE *stream);
} subcommand;

static const subcommand subcommands[] = {
    {"fit", "fit a sparse model to a molecule's surface", cli_fit, cli_fit_help},
    {"mesh", "write a surface as a triangle mesh", cli_mesh, cli_mesh_help},
    {"measure", "compare a model's surface with its molecule's", cli_measure, cli_measure_help},
    {"export", "write a model or a field for another program", cli_export, cli_export_help},
    {"render", "take a picture of a molecule's and a model's surface", cli_render, cli_render_help},
    {"devices", "list the OpenCL devices", cli_devices, cli_devices_help},
    {"selftest", "test whether a device computes rightly", cli_selftest, cli_selftest_help},
};
enum { SUBCOMMANDS = sizeof subcommands / sizeof subcommands[0] };

static const char *subject; /* what messages are about, NULL: nothing in particular */
static const char *speaker; /* who says them, NULL: the program */
static char *last_error;

/* The text of a message; NULL without memory. */
static char *compose(const char *format, va_list args) {
    va_list again;
    va_copy(again, args);
    const int length = vsnprintf(NULL, 0, format, args);
    char *text = length < 0 ? NULL : malloc((size_t)length + 1);
    if (text)
        vsnprintf(text, (size_t)length + 1, format, again);
    va_end(again);
    return text;
}

/* Returns the text, without the subject; NULL without memory. */
static char *print_message(const char *kind, const char *format, va_list args) {
    char *text = compose(format, args);
    const char *const shown = text ? text : format;
    cli_progress_erase();
    fflush(stdout); /* so that both streams read in order where they end up in one place */
    fprintf(stderr, "ovoid: %s%s", speaker ? speaker : "", speaker ? ": " : "");
    if (subject && !strstr(shown, subject))
        fprintf(stderr, "%s: %s: %s\n", kind, subject, shown);
    else
        fprintf(stderr, "%s: %s\n", kind, shown);
    return text;
}

void cli_message_subject(const char *about) {
    subject = about;
    free(last_error);
    last_error = NULL;
}

void cli_message_speaker(const char *who) {
    speaker = who;
}

const char *cli_last_error(void) {
    return last_error ? last_error : "";
}

void cli_error(const char *format, ...) {
    va_list args;
    va_start(args, format);
    free(last_error);
    last_error = print_message("error", format, args);
    va_end(args);
}

void cli_warning(const char *format, ...) {
    va_list args;
    va_start(args, format);
    free(print_message("warning", format, args));
    va_end(args);
}

void cli_note(const char *format, ...) {
    va_list args;
    va_start(args, format);
    free(print_message("note", format, args));
    va_end(args);
}

void cli_on_warning(const char *text, void *quiet) {
    if (!*(const bool *)quiet)
        cli_warning("%s", text);
}

bool cli_context(bool *quiet, ovoid_context **context, int *code) {
    if (ovoid_context_create(context) != OVOID_OK) {
        cli_error("out of memory");
        *code = CLI_COMPUTE;
        return false;
    }
    ovoid_context_on_warning(*context, cli_on_warning, quiet);
    cli_watch(*context, *quiet);
    return true;
}

int cli_failure(const ovoid_context *context, ovoid_status status, int io) {
    int number = cli_interrupted();
    if (number) {
        cli_tell_interrupted();
        return 128 + number;
    }
    const char *text = ovoid_context_error(context);
    cli_error("%s", text[0] ? text : ovoid_status_name(status));
    switch (status) {
    case OVOID_OK:
        return CLI_OK;
    case OVOID_ERROR_ARGUMENT:
        return CLI_USAGE;
    case OVOID_ERROR_IO:
        return io;
    case OVOID_ERROR_FORMAT:
    case OVOID_ERROR_EMPTY:
        return CLI_INPUT;
    case OVOID_ERROR_DEVICE:
        return CLI_DEVICE;
    case OVOID_ERROR_MEMORY:
    case OVOID_ERROR_LIMIT:
    case OVOID_ERROR_NUMERIC:
        return CLI_COMPUTE;
    case OVOID_ERROR_OPENCL:
    case OVOID_ERROR_CANCELLED:
        break;
    }
    return CLI_INTERNAL;
}

double cli_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Device and inode of the folder that holds `path`. */
static bool folder_of(const char *path, struct stat *info) {
    const char *slash = strrchr(path, '/');
    char *folder = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup(".");
    bool found = folder && stat(folder, info) == 0;
    free(folder);
    return found;
}

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

bool cli_same_file(const char *a, const char *b) {
    struct stat x, y;
    if (strcmp(a, b) == 0)
        return true;
    int missing = (stat(a, &x) != 0) + (stat(b, &y) != 0);
    if (missing == 0) /* two names of a device, such as a terminal, are no conflict */
        return S_ISREG(x.st_mode) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
    return missing == 2 && strcmp(last_part(a), last_part(b)) == 0 && folder_of(a, &x) &&
           folder_of(b, &y) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

void cli_print_exit_codes(FILE *stream) {
    fputs("Exit codes:\n"
          "  0    done\n"
          "  1    an OpenCL call or the program itself failed\n"
          "  2    wrong options\n"
          "  3    the input cannot be read, is malformed or empty\n"
          "  4    an output cannot be written\n"
          "  5    no OpenCL device, none that matches, or one that computes wrongly\n"
          "  6    out of memory, over a limit, or numbers that are not finite\n"
          "  7    a fit did not reach its goal: the best model it found is written\n"
          "  8    of several molecules some were fitted and some failed\n"
          "  9    of several molecules none was fitted, for different reasons (for one: its code)\n"
          "  10   a fit's --time-limit was over before any model held: nothing is written\n"
          "  130  interrupted with Ctrl-C (143: terminated, 129: hung up)\n",
          stream);
}

void cli_print_environment(FILE *stream) {
    fputs(
        "Environment:\n"
        "  OVOID_DEVICE     the device, or list, to use when --device is not given\n"
        "  OVOID_CACHE      whether compiled kernels are kept: auto (unless the driver does so\n"
        "                   itself; the default), on or off\n"
        "  OVOID_CACHE_DIR  where they are kept, instead of $XDG_CACHE_HOME/ovoid or\n"
        "                   ~/.cache/ovoid\n"
        "  OVOID_SELFTEST   whether the first use of a device with a driver tests it: auto (once,\n"
        "                   which is remembered where compiled kernels are kept; the default),\n"
        "                   on (in every run) or off\n",
        stream);
}

static void print_help(FILE *stream) {
    fputs("Usage: ovoid COMMAND [OPTION]...\n"
          "\n"
          "Represents a molecule's Gaussian surface with a few rotated ellipsoid Gaussians\n"
          "instead of one Gaussian per atom, computed on any OpenCL device.\n"
          "\n"
          "Commands:\n",
          stream);
    for (int i = 0; i < SUBCOMMANDS; i++)
        fprintf(stream, "  %-8s  %s\n", subcommands[i].name, subcommands[i].summary);
    fputs("  help      show this help, or with a command's name the help of that command\n"
          "\n"
          "Options:\n"
          "  -h, --help  show this help; after a command, the help of that command\n"
          "  --version   show the version\n"
          "\n"
          "Examples:\n"
          "  ovoid devices           what can do the work here?\n"
          "  ovoid fit molecule.pqr  fit a model and write molecule.ovoid\n"
          "  ovoid help fit          what else can be said about a fit\n"
          "\n",
          stream);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

static const subcommand *find_subcommand(const char *name) {
    for (int i = 0; i < SUBCOMMANDS; i++)
        if (strcmp(name, subcommands[i].name) == 0)
            return &subcommands[i];
    return NULL;
}

static int unknown_subcommand(const char *name) {
    const char *names[SUBCOMMANDS + 2] = {"help"};
    for (int i = 0; i < SUBCOMMANDS; i++)
        names[i + 1] = subcommands[i].name;
    const char *near = cli_nearest(name, names);
    if (near)
        cli_error("there is no command '%s'; did you mean '%s'? ('ovoid --help' lists all)", name,
                  near);
    else
        cli_error("there is no command '%s' ('ovoid --help' lists all)", name);
    return CLI_USAGE;
}

static int help(int argc, char **argv) {
    if (argc < 2) {
        print_help(stdout);
        return CLI_OK;
    }
    const subcommand *found = find_subcommand(argv[1]);
    if (!found)
        return unknown_subcommand(argv[1]);
    found->help(stdout);
    return CLI_OK;
}

static int run(int argc, char **argv) {
    if (argc < 2) {
        print_help(stderr);
        return CLI_USAGE;
    }
    const char *first = argv[1];
    if (strcmp(first, "--version") == 0) {
        printf("ovoid %s\n%s", ovoid_version(), ranks_version());
        return CLI_OK;
    }
    if (strcmp(first, "--help") == 0 || strcmp(first, "-h") == 0 || strcmp(first, "help") == 0)
        return help(argc - 1, argv + 1);
    const subcommand *found = find_subcommand(first);
    if (found)
        return found->run(argc - 1, argv + 1);
    if (first[0] == '-') {
        cli_error("there is no option '%s' before a command ('ovoid --help' lists all)", first);
        return CLI_USAGE;
    }
    return unknown_subcommand(first);
}

/* Takes the place of standard streams that were closed, so that no file of ours gets their number.
 * Reading standard input then finds nothing and writing the others fails. */
static void open_standard_streams(void) {
    for (int descriptor = 0; descriptor < 3; descriptor++)
        if (fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
            (void)!open("/dev/null", O_RDONLY | O_NOCTTY);
}

/* Large arrays of one stage are of no use to the next: glibc is to give them back when they are
 * freed, where by default it begins to keep them after the first ones. */
static void return_large_arrays(void) {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 4 << 20);
    mallopt(M_TRIM_THRESHOLD, 8 << 20);
#endif
}

int main(int argc, char **argv) {
    static char buffer[1 << 16]; /* for any help, so that the flush below knows why it failed */
    open_standard_streams();
    return_large_arrays();
    if (!isatty(STDOUT_FILENO))
        setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    cli_catch_signals();
    ovoid_prepare_process();
    int code;
    if (ranks_serve(&argc, &argv, &code))
        return code;
    code = run(argc, argv);
    errno = 0;
    if (fflush(stdout) != 0 || ferror(stdout)) {
        /* Whoever asked for the output to be written has reported it already. */
        if (code == CLI_OK && cli_interrupted()) {
            cli_tell_interrupted();
            code = 128 + cli_interrupted();
        } else if (code == CLI_OK) {
            cli_error("cannot write standard output: %s", strerror(errno ? errno : EIO));
            code = CLI_OUTPUT;
        }
    }
    ranks_end();
    return code;
}
