/*
 * The progress line on a terminal of its own, by a clock that the tests set: what is drawn depends
 * on the states shown and on this clock, not on how fast the machine is.
 */
#define _GNU_SOURCE /* posix_openpt() and its companions */

#include "support.h"

#include "cli/cli.h"
#include "cli/forecast.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { MARK = 1 };

static double clock_seconds;
static int master, slave, own_stderr;

double cli_seconds(void) {
    return clock_seconds;
}

/* ---- the terminal ------------------------------------------------------------------------- */

static void set_width(unsigned short columns) {
    const struct winsize size = {.ws_row = 24, .ws_col = columns};
    assert_int_equal(ioctl(slave, TIOCSWINSZ, &size), 0);
}

static int open_terminal(void **state) {
    (void)state;
    master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0)
        return -1;
    slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    own_stderr = dup(STDERR_FILENO);
    return slave >= 0 && own_stderr >= 0 ? 0 : -1;
}

static int close_terminal(void **state) {
    (void)state;
    close(slave);
    close(master);
    close(own_stderr);
    return 0;
}

static int reset(void **state) {
    (void)state;
    clock_seconds = 100.0;
    set_width(90);
    return setenv("TERM", "xterm", 1);
}

/* Standard error is the terminal only while the line is at work: cmocka speaks there, too. */
static void enter(void) {
    fflush(stderr);
    assert_true(dup2(slave, STDERR_FILENO) >= 0);
}

/* Fails unless the terminal has got this since enter(): what it has got ends where a mark comes. */
static void leave(const char *wanted) {
    char got[512], mark = MARK;
    size_t length = 0;
    assert_int_equal(write(slave, &mark, 1), 1);
    assert_true(dup2(own_stderr, STDERR_FILENO) >= 0);
    do
        assert_int_equal(read(master, got + length, 1), 1);
    while (got[length] != MARK && ++length < sizeof got);
    assert_true(length < sizeof got);
    got[length] = '\0';
    assert_string_equal(got, wanted);
}

static void start(bool quiet, const char *label) {
    enter();
    cli_progress_start(quiet, label);
    leave("");
}

static void erase(const char *wanted) {
    enter();
    cli_progress_erase();
    leave(wanted);
}

static void show(ovoid_progress progress, const char *wanted) {
    enter();
    cli_progress_show(&progress);
    leave(wanted);
}

static ovoid_progress sample(uint64_t points) {
    return (ovoid_progress){
        .stage = "sample", .iterations = OVOID_UNKNOWN, .points = points, .ellipsoids = 100};
}

static ovoid_progress adaptive(const char *stage, uint64_t step) {
    return (ovoid_progress){.stage = stage,
                            .method = OVOID_METHOD_ADAPTIVE,
                            .iteration = step,
                            .iterations = OVOID_UNKNOWN,
                            .ellipsoids = 30,
                            .seconds = 1.9};
}

/* One of 112 iterations of method l1. */
static ovoid_progress l1(const char *stage, uint64_t iteration, double seconds) {
    return (ovoid_progress){.stage = stage,
                            .method = OVOID_METHOD_L1,
                            .iteration = iteration,
                            .iterations = 112,
                            .ellipsoids = 30,
                            .l1.max_error = 0.25,
                            .seconds = seconds};
}

/* ---- tests -------------------------------------------------------------------------------- */

static void each_stage_is_drawn_at_once(void **state) {
    (void)state;
    start(false, NULL);
    show(sample(10), "\rsample  10 points  0 s\033[K");
    show(sample(20), "");
    show(adaptive("merge", 0), "\rmerge  30 ellipsoids  1 s\033[K");
    show(adaptive("refine", 1), "\rrefine  step 1  30 ellipsoids  1 s\033[K");
    show(adaptive("refine", 2), "");
    show(adaptive("merge", 2), "\rmerge  step 2  30 ellipsoids  1 s\033[K"); /* again */
    erase("\r\033[K");
    erase("");
}

static void within_a_stage_the_clock_decides(void **state) {
    (void)state;
    start(false, NULL);
    show(adaptive("refine", 1), "\rrefine  step 1  30 ellipsoids  1 s\033[K");
    clock_seconds += 0.09;
    show(adaptive("refine", 2), "");
    clock_seconds += 0.02;
    show(adaptive("refine", 3), "\rrefine  step 3  30 ellipsoids  1 s\033[K");
    clock_seconds += 0.09; /* since the last one that was drawn */
    show(adaptive("refine", 4), "");
    clock_seconds += 3600.0;
    show(adaptive("refine", 5), "\rrefine  step 5  30 ellipsoids  1 s\033[K");
}

static void each_level_begins_at_once(void **state) {
    (void)state;
    start(false, "level 1/2");
    show(adaptive("refine", 9), "\rlevel 1/2  refine  step 9  30 ellipsoids  1 s\033[K");
    erase("\r\033[K");
    start(false, "level 2/2");
    show(adaptive("refine", 1), "\rlevel 2/2  refine  step 1  30 ellipsoids  1 s\033[K");
    show(adaptive("refine", 2), "");
    erase("\r\033[K");
}

static ovoid_progress part(const char *stage, uint64_t done, uint64_t total, double seconds) {
    return (ovoid_progress){.stage = stage,
                            .method = OVOID_NO_METHOD,
                            .done = done,
                            .total = total ? total : OVOID_UNKNOWN,
                            .seconds = seconds};
}

/* What is no fit shows its share, and nothing where it is done at once. */
static void other_work_shows_its_share(void **state) {
    (void)state;
    start(false, NULL);
    show(part("read", 1, 2, 0.4), "");
    show(part("mesh", 1, 4, 0.5), "\rmesh  25 %  0 s\033[K");
    show(part("mesh", 2, 4, 2.0), "");
    clock_seconds += 0.2;
    show(part("mesh", 2, 3, 2.0), "\rmesh  66 %  2 s\033[K");
    show(part("open", 0, 0, 3.0), "\ropen  3 s\033[K"); /* nobody knows of how much */
    show(part("write", 7, 7, 61.0), "\rwrite  100 %  1 min 01 s\033[K");
    erase("\r\033[K");
    start(true, NULL);
    show(part("mesh", 1, 4, 5.0), "");
}

/* A message takes the line away; the next state brings it back. */
static void what_was_erased_returns(void **state) {
    (void)state;
    start(false, NULL);
    show(adaptive("refine", 1), "\rrefine  step 1  30 ellipsoids  1 s\033[K");
    erase("\r\033[K");
    show(adaptive("refine", 2), "\rrefine  step 2  30 ellipsoids  1 s\033[K");
}

/* What is left follows from the iterations after a stage's first, which sampling came before. */
static void time_left_is_that_of_iterations(void **state) {
    (void)state;
    start(false, NULL);
    show((ovoid_progress){.stage = "sample",
                          .method = OVOID_METHOD_L1,
                          .iterations = 112,
                          .points = 10,
                          .seconds = 50.0},
         "\rsample  10 points  50 s\033[K");
    show(l1("sparse", 1, 60.0),
         "\rsparse  1/112  30 ellipsoids  error 0.250  [....................]\033[K");
    clock_seconds += 1.0; /* 16 iterations in 2 s: 95 take 11.875 s */
    show(l1("sparse", 17, 62.0),
         "\rsparse  17/112  30 ellipsoids  error 0.250  12 s left  [###.................]\033[K");
    clock_seconds += 1.0; /* half as fast: 0.8 * 0.125 + 0.2 * 0.25 = 0.15 s for each of 64 */
    show(l1("sparse", 48, 69.75),
         "\rsparse  48/112  30 ellipsoids  error 0.250  10 s left  [########............]\033[K");
    show(l1("accuracy", 49, 99.0), /* what prepared it does not count */
         "\raccuracy  49/112  30 ellipsoids  error 0.250  10 s left  [########............]\033[K");
    clock_seconds += 1.0;
    show(l1("accuracy", 112, 99.1),
         "\raccuracy  112/112  30 ellipsoids  error 0.250  0 s left  [####################]\033[K");
}

static ovoid_progress of_parts(const char *stage, uint64_t done, uint64_t total, double seconds) {
    ovoid_progress progress = adaptive(stage, 0);
    progress.done = done;
    progress.total = total;
    progress.seconds = seconds;
    return progress;
}

static double left(cli_forecast *forecast, const char *stage, uint64_t done, uint64_t total,
                   double seconds, uint64_t at_once) {
    const ovoid_progress progress = of_parts(stage, done, total, seconds);
    return cli_forecast_left(forecast, &progress, at_once);
}

/* Parts tell how long the others take: once so many are done as are fitted at a time, without those
 * of a checkpoint, and not in stages that count something else. */
static void parts_tell_what_is_left(void **state) {
    (void)state;
    cli_forecast f = {0};
    assert_true(left(&f, "compile", 3, 5, 1.0, 1) == 0.0);
    assert_true(left(&f, "sample", 0, 11, 2.0, 1) == 0.0);
    assert_true(left(&f, "refine", 0, 11, 9.0, 1) == 0.0);
    assert_true(left(&f, "sample", 1, 11, 12.0, 1) == 100.0); /* 10 s each, of 10 */
    assert_true(left(&f, "refine", 1, 11, 15.0, 1) == 97.0);  /* 3 s of them are over */
    assert_true(left(&f, "refine", 1, 11, 500.0, 1) == 1.0);
    assert_true(left(&f, "measure", 4, 11, 600.0, 1) == 0.0);
    assert_true(left(&f, "sample", 6, 11, 602.0, 1) == 500.0);
    assert_true(left(&f, "mend", 0, 3, 700.0, 1) == 0.0);
    assert_true(left(&f, "sample", 0, 3, 700.0, 1) == 0.0); /* patches are no parts */
    assert_true(left(&f, "sample", 1, 3, 800.0, 1) == 0.0);
    f = (cli_forecast){0};
    assert_true(left(&f, "sample", 20, 40, 1.0, 2) == 0.0); /* resumed */
    assert_true(left(&f, "sample", 21, 40, 11.0, 2) == 0.0);
    assert_true(left(&f, "sample", 22, 40, 13.0, 2) == 6.0 * 18.0);
    f = (cli_forecast){0};
    assert_true(left(&f, "sample", 0, 1, 1.0, 1) == 0.0); /* a whole */
    assert_true(left(&f, "sample", 0, OVOID_UNKNOWN, 1.0, 1) == 0.0);
    start(false, NULL);
    show(of_parts("sample", 0, 3, 1.0), "\rsample  0/3 parts  0 points  1 s\033[K");
    clock_seconds += 1.0;
    show(of_parts("sample", 1, 3, 41.0),
         "\rsample  1/3 parts  1 min 20 s left  0 points  41 s\033[K");
}

static void narrow_terminals_get_what_fits(void **state) {
    (void)state;
    set_width(30); /* 29 columns: the last one would wrap */
    start(false, NULL);
    show(l1("sparse", 1, 1.0), "\rsparse  1/112  30 ellipsoids\033[K");
    set_width(28);
    erase("\r\033[K");
    show(l1("sparse", 2, 1.5), "\rsparse  2/112  error 0.250\033[K");
    set_width(1);
    erase("\r\033[K");
    show(l1("sparse", 3, 2.0), "\r\033[K");
}

static void shown_on_terminals_alone(void **state) {
    (void)state;
    start(true, NULL);
    show(adaptive("refine", 1), "");
    erase("");
    static const char *const dumb[] = {"dumb", ""};
    for (size_t i = 0; i < sizeof dumb / sizeof *dumb; ++i) {
        assert_int_equal(setenv("TERM", dumb[i], 1), 0);
        start(false, NULL);
        show(adaptive("refine", 1), "");
    }
    assert_int_equal(unsetenv("TERM"), 0);
    start(false, NULL);
    show(adaptive("refine", 1), "");
    assert_int_equal(setenv("TERM", "xterm", 1), 0);
    const int terminal = slave, file = open("/dev/null", O_WRONLY);
    assert_true(file >= 0);
    enter();
    assert_true(dup2(file, STDERR_FILENO) >= 0);
    cli_progress_start(false, NULL);
    assert_true(dup2(terminal, STDERR_FILENO) >= 0);
    leave("");
    close(file);
    show(adaptive("refine", 1), "");
}

static void durations(void **state) {
    (void)state;
    static const struct {
        double seconds;
        const char *text;
    } cases[] = {{0.0, "0 s"},           {0.1, "1 s"},
                 {59.0, "59 s"},         {59.5, "1 min 00 s"},
                 {127.0, "2 min 07 s"},  {3600.0, "1 h 00 min"},
                 {3900.0, "1 h 05 min"}, {1e30, "27777 h 46 min"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char text[64];
        cli_print_duration(cases[i].seconds, text, sizeof text);
        assert_string_equal(text, cases[i].text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(each_stage_is_drawn_at_once, reset),
        cmocka_unit_test_setup(within_a_stage_the_clock_decides, reset),
        cmocka_unit_test_setup(each_level_begins_at_once, reset),
        cmocka_unit_test_setup(other_work_shows_its_share, reset),
        cmocka_unit_test_setup(what_was_erased_returns, reset),
        cmocka_unit_test_setup(time_left_is_that_of_iterations, reset),
        cmocka_unit_test_setup(parts_tell_what_is_left, reset),
        cmocka_unit_test_setup(narrow_terminals_get_what_fits, reset),
        cmocka_unit_test_setup(shown_on_terminals_alone, reset),
        cmocka_unit_test(durations),
    };
    return cmocka_run_group_tests(tests, open_terminal, close_terminal);
}
