/*
 * A child that inherits contexts and fields: clear errors within a moment, no hang, and its own end
 * is clean. What needs no device works.
 */
#include "support.h"

#include "ovoid/ovoid.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

enum { SECONDS = 20 };

typedef struct heirloom {
    ovoid_context *context, *fresh; /* with a device, and without */
    ovoid_molecule *molecule;
    ovoid_field *field;
} heirloom;

static const double xyzr[8] = {0.0, 0.0, 0.0, 1.5, 1.2, 0.0, 0.0, 1.7};

static void make(heirloom *h) {
    assert_int_equal(ovoid_context_create(&h->context), OVOID_OK);
    assert_int_equal(ovoid_context_create(&h->fresh), OVOID_OK);
    test_check(h->context, ovoid_molecule_create(h->context, xyzr, 2, &h->molecule));
    test_check(h->context, ovoid_field_of_molecule(h->context, h->molecule, 0.5, 1.0, &h->field));
}

static void destroy(heirloom *h) {
    ovoid_field_destroy(&h->field);
    ovoid_molecule_destroy(&h->molecule);
    ovoid_context_destroy(&h->context);
    ovoid_context_destroy(&h->fresh);
}

static ovoid_status evaluate(heirloom *h) {
    double value;
    return ovoid_field_evaluate(h->context, h->field, xyzr, 1, &value, NULL);
}

/* The exit code of `child`, which runs in a child of this process; killed when it hangs. */
static int run_child(int (*child)(heirloom *h), heirloom *h) {
    int status = 0;
    fflush(NULL);
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        alarm(SECONDS);
        const int code = child(h);
        _exit(code);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (WIFSIGNALED(status))
        fail_msg("the child ended by signal %d%s", WTERMSIG(status),
                 WTERMSIG(status) == SIGALRM ? ": it hung" : "");
    return WEXITSTATUS(status);
}

static bool is_refused(ovoid_context *context, ovoid_status status) {
    return status == OVOID_ERROR_DEVICE && strstr(ovoid_context_error(context), "forked") != NULL;
}

/* Each line of the exit code's list is one thing that went wrong. */
static int inherit(heirloom *h) {
    ovoid_fit_options fitting;
    ovoid_mesh_options meshing;
    ovoid_device_info *devices = NULL;
    ovoid_model *model = NULL;
    ovoid_mesh *mesh = NULL;
    ovoid_context *another = NULL;
    size_t count = 0;
    ovoid_fit_options_init(&fitting, sizeof fitting);
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    if (!is_refused(h->context, evaluate(h)))
        return 1;
    if (!is_refused(h->context, ovoid_field_mesh(h->context, h->field, &meshing, &mesh)))
        return 2;
    if (!is_refused(h->context, ovoid_fit(h->context, h->molecule, &fitting, &model, NULL)))
        return 3;
    if (!is_refused(h->context, ovoid_context_open_device(h->context, NULL)))
        return 4;
    if (!is_refused(h->fresh, ovoid_devices(h->fresh, sizeof *devices, &devices, &count)))
        return 5;
    if (!is_refused(h->context, ovoid_context_profile(h->context, false)))
        return 6;
    if (ovoid_context_create(&another) != OVOID_OK ||
        !is_refused(another, ovoid_context_open_device(another, NULL)))
        return 7;
    ovoid_molecule *molecule = NULL;
    if (ovoid_molecule_create(h->context, xyzr, 1, &molecule) != OVOID_OK)
        return 8;
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&another);
    destroy(h);
    return h->field || h->context ? 9 : 42;
}

static void a_child_gets_errors(void **state) {
    (void)state;
    heirloom h;
    make(&h);
    test_check(h.context, evaluate(&h));
    for (int profiled = 0; profiled < 2; ++profiled) {
        test_check(h.context, ovoid_context_profile(h.context, profiled));
        test_check(h.context, evaluate(&h));
        assert_int_equal(run_child(inherit, &h), 42);
    }
    test_check(h.context, evaluate(&h)); /* the parent goes on */
    destroy(&h);
}

static int work(heirloom *h) {
    const ovoid_status status = evaluate(h);
    destroy(h);
    return status == OVOID_OK ? 42 : 1;
}

/* Before the first use of OpenCL a fork costs nothing: parent and child both work. It comes first:
 * afterwards this process has used it. */
static void forking_early_is_fine(void **state) {
    (void)state;
    heirloom h;
    make(&h);
    assert_int_equal(run_child(work, &h), 42);
    test_check(h.context, evaluate(&h));
    destroy(&h);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forking_early_is_fine),
        cmocka_unit_test(a_child_gets_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
