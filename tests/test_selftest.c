/*
 * The self-test: that it leaves out no kernel, and finds one that is wrong; and the first use of a
 * device: when its short form runs, what is remembered, and what is said. Cases of the first use
 * run in children, since a process remembers: this program with the argument "child".
 */
#define _XOPEN_SOURCE 700 /* nftw */

#include "device/internal.h"
#include "ovoid/selftest.h"
#include "support.h"

#include <dirent.h>
#include <ftw.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { PATH_SIZE = 512 };

static char scratch[PATH_SIZE - 128]; /* a folder of this run */
static const char *self;

static const char *in_scratch(const char *name) {
    static char paths[8][PATH_SIZE];
    static int next;
    char *const path = paths[next++ % 8];
    snprintf(path, PATH_SIZE, "%s/%s", scratch, name);
    return path;
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *where) {
    (void)info, (void)kind, (void)where;
    return remove(path);
}

static void remove_tree(const char *path) {
    nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

static int make_scratch(void **state) {
    const char *const base = getenv("TMPDIR");
    snprintf(scratch, sizeof scratch, "%.300s/ovoid-selftest-XXXXXX", base ? base : "/tmp");
    return mkdtemp(scratch) ? test_open(state) : -1;
}

static int remove_scratch(void **state) {
    remove_tree(scratch);
    return test_close(state);
}

/* ---- the checks --------------------------------------------------------------------------- */

typedef struct told {
    size_t count;
    uint32_t by_verdict[3];
    char last_wrong[256]; /* name and text */
} told;

static void keep(const ovoid_check *check, void *user) {
    told *const t = user;
    assert_int_equal(check->size, sizeof *check);
    assert_true(check->seconds >= 0.0 && check->compared > 0);
    assert_true((check->verdict == OVOID_CHECK_PASSED) == (check->text[0] == '\0'));
    assert_true((check->verdict == OVOID_CHECK_PASSED) == (check->error <= 1.0));
    ++t->count;
    ++t->by_verdict[check->verdict];
    if (check->verdict == OVOID_CHECK_WRONG)
        snprintf(t->last_wrong, sizeof t->last_wrong, "%s: %s", check->name, check->text);
}

/* Whether a check names it; render.cl's need not be of the short form. */
static bool is_checked(const char *file, const char *name) {
    size_t count;
    const ov_check *const checks = ov_checks(&count);
    char spaced[70], list[512];
    bool found = false;
    snprintf(spaced, sizeof spaced, " %s ", name);
    for (size_t k = 0; k < count; ++k) {
        snprintf(list, sizeof list, " %s ", checks[k].kernels);
        found =
            found || (strstr(list, spaced) && (checks[k].brief || strcmp(file, "render.cl") == 0));
    }
    return found;
}

/* After "kernel void" or a macro that ends so, as in "SOLVE_KERNEL void". */
static void no_kernel_is_left_out(void **state) {
    (void)state;
    size_t kernels = 0;
    for (const ov_source *source = ov_sources; source->name; ++source)
        for (const char *at = source->text; (at = strstr(at, "void")) != NULL; at += 4) {
            char name[61];
            if (at < source->text + 7 ||
                (memcmp(at - 7, "kernel ", 7) != 0 && memcmp(at - 7, "KERNEL ", 7) != 0) ||
                sscanf(at + 4, " %60[a-z0-9_]", name) != 1)
                continue;
            if (!is_checked(source->name, name))
                fail_msg("no check looks at kernel %s of %s", name, source->name);
            ++kernels;
        }
    print_message("%zu kernels\n", kernels);
    assert_true(kernels > 35);
}

/* ---- a kernel that is wrong --------------------------------------------------------------- */

static void write_text(const char *path, const char *text) {
    FILE *const file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, strlen(text), file), strlen(text));
    assert_int_equal(fclose(file), 0);
}

/* A folder with all sources, one of them changed in one place. */
static void break_kernel(const char *folder, const char *file, const char *old, const char *new) {
    char path[2 * PATH_SIZE];
    mkdir(folder, 0700);
    for (const ov_source *source = ov_sources; source->name; ++source) {
        const char *const at = strstr(source->text, old);
        char *const text = test_alloc(strlen(source->text) + strlen(new) + 1, 1);
        snprintf(path, sizeof path, "%s/%s", folder, source->name);
        strcpy(text, source->text);
        if (strcmp(source->name, file) == 0) {
            assert_non_null(at);
            sprintf(text + (at - source->text), "%s%s", new, at + strlen(old));
        }
        write_text(path, text);
        free(text);
    }
}

static void wrong_kernel_is_found(void **state) {
    (void)state;
    told t = {0};
    ovoid_context *context = NULL;
    ovoid_selftest_options options;
    ovoid_selftest_result result;
    ovoid_selftest_options_init(&options, sizeof options);
    ovoid_selftest_result_init(&result, sizeof result);
    options.brief = true;
    break_kernel(in_scratch("wrong"), "misfit.cl", "const float4 wr = w * r;",
                 "const float4 wr = w * r * 1.0001f;");
    setenv("OVOID_KERNEL_DIR", in_scratch("wrong"), 1);
    test_check(NULL, ovoid_context_create(&context));
    test_check(context, ovoid_selftest(context, &options, keep, &t, &result));
    unsetenv("OVOID_KERNEL_DIR");
    assert_int_equal(result.wrong, 1);
    assert_int_equal(result.passed, t.count - 1);
    assert_int_equal(strncmp(t.last_wrong, "misfit: misfit: residual ", 25), 0);
    ovoid_context_destroy(&context);
}

/* ---- the first use, in a child ------------------------------------------------------------ */

ovoid_status __real_ov_selftest_brief(ovoid_context *context, char text[OV_SELFTEST_TEXT],
                                      bool *whole);
ovoid_status __wrap_ov_selftest_brief(ovoid_context *context, char text[OV_SELFTEST_TEXT],
                                      bool *whole);

static unsigned tests_run;

/* What the short form finds is what the environment says, or what it does find. */
ovoid_status __wrap_ov_selftest_brief(ovoid_context *context, char text[OV_SELFTEST_TEXT],
                                      bool *whole) {
    const char *const what = getenv("TEST_OUTCOME");
    ++tests_run;
    if (!what)
        return __real_ov_selftest_brief(context, text, whole);
    snprintf(text, OV_SELFTEST_TEXT, "%s", strcmp(what, "wrong") == 0 ? "2 and 2 are 5" : "");
    *whole = strcmp(what, "failed") != 0;
    return OVOID_OK;
}

static void print_warning(const char *text, void *user) {
    (void)user;
    printf("warning: %s\n", text);
}

static bool stop_in_selftest(const ovoid_progress *progress, void *user) {
    (void)user;
    return strcmp(progress->stage, "selftest") != 0;
}

/* Opens a device twice and makes kernels there, and says how often it was tested and what came. */
static int child(void) {
    for (int n = 0; n < 2; ++n) {
        ovoid_context *context = NULL;
        if (ovoid_context_create(&context) != OVOID_OK)
            return 1;
        ovoid_context_on_warning(context, print_warning, NULL);
        if (getenv("TEST_STOP"))
            ovoid_context_on_progress(context, stop_in_selftest, NULL);
        if (ovoid_context_open_device(context, NULL) != OVOID_OK)
            return 1;
        printf("opened: %u\n", tests_run);
        for (int again = 0; again < 2; ++again) {
            ov_kernel kernel = {0};
            const ovoid_status status = ov_kernel_create(context, "layout", "layout", &kernel);
            printf("kernel: %u %s %s\n", tests_run, ovoid_status_name(status),
                   status == OVOID_OK ? "" : ovoid_context_error(context));
            ov_kernel_destroy(&kernel);
        }
        printf("launches: %u\n", (unsigned)ovoid_context_count(context, OVOID_COUNT_LAUNCHES));
        ovoid_context_destroy(&context);
    }
    return 0;
}

typedef struct running {
    pid_t pid;
    int from;
} running;

static running start_child(const char *const *environment) {
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        setenv("OVOID_CACHE_DIR", in_scratch("cache"), 1);
        unsetenv("OVOID_SELFTEST");
        for (; *environment; ++environment)
            putenv((char *)*environment);
        dup2(ends[1], 1);
        dup2(ends[1], 2);
        close(ends[0]);
        close(ends[1]);
        execl(self, self, "child", (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    return (running){pid, ends[0]};
}

static char *end_child(running r) {
    static char texts[4][1 << 14];
    static int next;
    char *const text = texts[next++ % 4];
    size_t length = 0;
    ssize_t got;
    int outcome;
    while (length < sizeof texts[0] - 1 &&
           (got = read(r.from, text + length, sizeof texts[0] - 1 - length)) > 0)
        length += (size_t)got;
    text[length] = '\0';
    close(r.from);
    assert_int_equal(waitpid(r.pid, &outcome, 0), r.pid);
    if (!WIFEXITED(outcome) || WEXITSTATUS(outcome) != 0)
        fail_msg("the child ended with %d: %s", outcome, text);
    return text;
}

#define CHILD(...) end_child(start_child((const char *const[]){__VA_ARGS__, NULL}))

static void expect(const char *text, const char *part) {
    if (!strstr(text, part))
        fail_msg("\"%s\" is missing in \"%s\"", part, text);
}

static void expect_none(const char *text, const char *part) {
    if (strstr(text, part))
        fail_msg("\"%s\" is unexpected in \"%s\"", part, text);
}

/* Tests in both contexts of the child together, none before a kernel was wanted. */
static void expect_tests(const char *text, unsigned tests) {
    char last[64];
    snprintf(last, sizeof last, "kernel: %u ok \nlaunches: 0\n", tests);
    expect(text, "opened: 0\n");
    const char *at = text;
    for (const char *more; (more = strstr(at + 1, "kernel: ")) != NULL;)
        at = more;
    assert_int_equal(strncmp(at, last, strlen(last)), 0);
}

/* Files kept; path of the last. */
static size_t kept(char path[2 * PATH_SIZE]) {
    size_t count = 0;
    DIR *const folder = opendir(in_scratch("cache"));
    struct dirent *entry;
    while (folder && (entry = readdir(folder)) != NULL)
        if (strncmp(entry->d_name, "selftest-", 9) == 0) {
            ++count;
            snprintf(path, 2 * PATH_SIZE, "%s/%s", in_scratch("cache"), entry->d_name);
        }
    if (folder)
        closedir(folder);
    return count;
}

static void forget(void) {
    remove_tree(in_scratch("cache"));
}

static void first_use_tests_and_remembers(void **state) {
    (void)state;
    char path[2 * PATH_SIZE];
    forget();
    expect_tests(CHILD("TEST_OUTCOME=passed"), 1);
    assert_int_equal(kept(path), 1);
    expect_tests(CHILD("TEST_OUTCOME=passed"), 0);
    expect_tests(CHILD("TEST_OUTCOME=passed", "OVOID_SHAPE=1x1"), 1); /* other kernels */
    assert_int_equal(kept(path), 2);
    expect_tests(CHILD("TEST_OUTCOME=wrong", "OVOID_SELFTEST=auto"), 0);
    expect_tests(CHILD("TEST_OUTCOME=passed", "OVOID_SELFTEST=on"), 1); /* once in the process */
    expect_tests(CHILD("TEST_OUTCOME=wrong", "OVOID_SELFTEST=off", "OVOID_SHAPE=4x1"), 0);
    assert_int_equal(kept(path), 2);
    const char *const text = CHILD("TEST_OUTCOME=passed", "OVOID_SELFTEST=sometimes");
    expect(text, "warning: OVOID_SELFTEST is none of auto, on, off: sometimes");
    expect_tests(text, 0);
    write_text(path, "ovoid program 1, or what is left of it"); /* damaged: not believed */
    forget();
    expect_tests(CHILD("TEST_OUTCOME=passed"), 1);
    assert_int_equal(kept(path), 1);
    assert_int_equal(truncate(path, 100), 0);
    expect_tests(CHILD("TEST_OUTCOME=passed"), 1);
    expect_tests(CHILD("TEST_OUTCOME=passed"), 0);
}

static void without_a_folder_each_process_tests(void **state) {
    (void)state;
    char path[2 * PATH_SIZE], setting[2 * PATH_SIZE];
    forget();
    const char *text = CHILD("TEST_OUTCOME=passed", "OVOID_CACHE=off");
    expect_tests(text, 1);
    expect_none(text, "warning");
    assert_int_equal(kept(path), 0);
    write_text(in_scratch("file"), "");
    snprintf(setting, sizeof setting, "OVOID_CACHE_DIR=%s/folder", in_scratch("file"));
    for (int n = 0; n < 2; ++n) {
        text = CHILD("TEST_OUTCOME=passed", setting);
        expect_tests(text, 1);
        expect(text, "is not kept for the next run: ");
    }
}

static void two_processes_at_once(void **state) {
    (void)state;
    char path[2 * PATH_SIZE];
    forget();
    const char *const passes[] = {"TEST_OUTCOME=passed", NULL};
    const running one = start_child(passes), other = start_child(passes);
    expect(end_child(one), " ok \n");
    expect(end_child(other), " ok \n");
    assert_int_equal(kept(path), 1);
    expect_tests(CHILD("TEST_OUTCOME=wrong"), 0);
}

static void wrong_device_is_refused(void **state) {
    char path[2 * PATH_SIZE];
    forget();
    for (int n = 0; n < 2; ++n) { /* nothing is remembered */
        const char *const text = CHILD("TEST_OUTCOME=wrong");
        expect(text, "kernel: 1 device device ");
        expect(text, ovoid_context_device(*state)->name);
        expect(text, "computes wrongly and is not used: 2 and 2 are 5\n");
        expect(text, "OVOID_SELFTEST=off");
        expect(text, "kernel: 2 device device "); /* of the second context, once */
        expect_none(text, "kernel: 3");
        expect_none(text, " ok ");
        assert_int_equal(kept(path), 0);
    }
}

/* Calls that fail are for the work itself to meet, and are tried again in the next process. */
static void failed_test_says_nothing(void **state) {
    (void)state;
    char path[2 * PATH_SIZE];
    forget();
    const char *const text = CHILD("TEST_OUTCOME=failed");
    expect_tests(text, 2);
    expect_none(text, "warning");
    assert_int_equal(kept(path), 0);
}

static void progress_stops_it(void **state) {
    (void)state;
    char path[2 * PATH_SIZE];
    forget();
    const char *const text = CHILD("TEST_STOP=1");
    expect(text, "kernel: 1 cancelled ");
    assert_int_equal(kept(path), 0);
}

/* Without anything between: a device with a wrong kernel, and one with the right ones. */
static void short_form_by_itself(void **state) {
    (void)state;
    char path[2 * PATH_SIZE], setting[2 * PATH_SIZE];
    forget();
    expect_tests(CHILD("OVOID_CACHE=auto"), 1);
    assert_int_equal(kept(path), 1);
    snprintf(setting, sizeof setting, "OVOID_KERNEL_DIR=%s", in_scratch("short"));
    break_kernel(in_scratch("short"), "solve.cl", "before > 0.0f ? before / curvature",
                 "before > 0.0f ? 0.9f * before / curvature");
    const char *const text = CHILD(setting);
    expect(text, "computes wrongly and is not used: solve_start");
    expect_none(text, " ok ");
    assert_int_equal(kept(path), 1);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_kernel_is_left_out),
        cmocka_unit_test(wrong_kernel_is_found),
        cmocka_unit_test(first_use_tests_and_remembers),
        cmocka_unit_test(without_a_folder_each_process_tests),
        cmocka_unit_test(two_processes_at_once),
        cmocka_unit_test(wrong_device_is_refused),
        cmocka_unit_test(failed_test_says_nothing),
        cmocka_unit_test(progress_stops_it),
        cmocka_unit_test(short_form_by_itself),
    };
    self = argv[0];
    if (argc == 2 && strcmp(argv[1], "child") == 0)
        return child();
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
