/* Output files that are whole or absent. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ovoid/ovoid.h"
#include "scratch.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

static ovoid_context *context;

static int make_context(void **state) {
    (void)state;
    return ovoid_context_create(&context) == OVOID_OK ? 0 : -1;
}

static int drop_context(void **state) {
    (void)state;
    ovoid_context_destroy(&context);
    return 0;
}

static void assert_error(const char *part) {
    if (!strstr(ovoid_context_error(context), part))
        fail_msg("'%s' does not say '%s'", ovoid_context_error(context), part);
}

static void assert_holds(const char *path, const char *text) {
    char *found = scratch_read(path);
    assert_non_null(found);
    assert_string_equal(found, text);
    free(found);
}

static ovoid_status put(const char *path, const char *text) {
    ovoid_file *file = NULL;
    ovoid_status status = ovoid_file_create(context, path, &file);
    if (status == OVOID_OK)
        status = ovoid_file_write(context, file, text, strlen(text));
    if (status == OVOID_OK)
        status = ovoid_file_commit(context, file);
    ovoid_file_destroy(&file);
    ovoid_file_destroy(&file);
    assert_null(file);
    return status;
}

static mode_t mode_of(const char *path) {
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    return info.st_mode & 07777;
}

static void new_file_gets_the_umask(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "new");
    mode_t before = umask(027);
    ovoid_status status = put(path, "text");
    umask(before);
    assert_int_equal(status, OVOID_OK);
    assert_holds(path, "text");
    assert_int_equal(mode_of(path), 0640);
    assert_int_equal(scratch_entries(s), 1);
}

static void replaced_file_keeps_its_mode(void **state) {
    const char *path = scratch_path(*state, "old");
    scratch_write(path, "old", 3);
    assert_int_equal(chmod(path, 0604), 0);
    assert_int_equal(put(path, "new"), OVOID_OK);
    assert_holds(path, "new");
    assert_int_equal(mode_of(path), 0604);
}

static void old_file_stays_until_the_commit(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "file");
    ovoid_file *file = NULL;
    scratch_write(path, "old", 3);
    assert_int_equal(ovoid_file_create(context, path, &file), OVOID_OK);
    assert_int_equal(ovoid_file_write(context, file, "new", 3), OVOID_OK);
    assert_holds(path, "old");
    assert_int_equal(scratch_entries(s), 2);
    assert_int_equal(ovoid_file_commit(context, file), OVOID_OK);
    assert_holds(path, "new");
    assert_int_equal(scratch_entries(s), 1);
    assert_int_equal(ovoid_file_write(context, file, "x", 1), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_file_commit(context, file), OVOID_ERROR_ARGUMENT);
    ovoid_file_destroy(&file);
    assert_holds(path, "new");
    assert_int_equal(scratch_entries(s), 1);
}

static void dropped_file_leaves_nothing(void **state) {
    scratch *s = *state;
    ovoid_file *file = NULL;
    assert_int_equal(ovoid_file_create(context, scratch_path(s, "file"), &file), OVOID_OK);
    assert_int_equal(ovoid_file_write(context, file, "new", 3), OVOID_OK);
    assert_int_equal(scratch_entries(s), 1);
    ovoid_file_destroy(&file);
    assert_int_equal(scratch_entries(s), 0);
}

/* As a signal handler does it: what was there stays, and the files cannot be finished any more. */
static void temporaries_can_be_removed(void **state) {
    enum { FILES = 3, MORE = 100 };
    scratch *s = *state;
    ovoid_file *files[FILES] = {NULL};
    char names[FILES][8];
    for (int i = 0; i < MORE; i++) /* those that were finished or dropped leave their room */
        assert_int_equal(put(scratch_path(s, "0"), "old"), OVOID_OK);
    for (int i = 0; i < FILES; i++) {
        snprintf(names[i], sizeof names[i], "%d", i);
        assert_int_equal(ovoid_file_create(context, scratch_path(s, names[i]), &files[i]),
                         OVOID_OK);
        assert_int_equal(ovoid_file_write(context, files[i], "new", 3), OVOID_OK);
    }
    ovoid_file_destroy(&files[2]);
    assert_int_equal(scratch_entries(s), 3);
    ovoid_remove_temporaries();
    ovoid_remove_temporaries();
    assert_int_equal(scratch_entries(s), 1);
    assert_int_equal(ovoid_file_commit(context, files[0]), OVOID_ERROR_IO);
    ovoid_file_destroy(&files[0]);
    ovoid_file_destroy(&files[1]);
    assert_holds(scratch_path(s, "0"), "old");
    assert_int_equal(scratch_entries(s), 1);
}

/* Stands in for fsync(): a signal that ends the process meets it while the folder is written. */
static bool end_at_folder;
int __wrap_fsync(int descriptor);
int __wrap_fsync(int descriptor) {
    struct stat info;
    if (end_at_folder && fstat(descriptor, &info) == 0 && S_ISDIR(info.st_mode))
        ovoid_remove_temporaries();
    return 0;
}

/* A file that was there before has its new contents by then. */
static void nothing_is_left_of_a_commit_that_a_signal_ends(void **state) {
    scratch *s = *state;
    assert_int_equal(put(scratch_path(s, "old"), "old"), OVOID_OK);
    end_at_folder = true;
    assert_int_equal(put(scratch_path(s, "old"), "new"), OVOID_OK);
    assert_int_equal(put(scratch_path(s, "fresh"), "new"), OVOID_OK);
    end_at_folder = false;
    assert_int_equal(scratch_entries(s), 1);
    assert_holds(scratch_path(s, "old"), "new");
    assert_int_equal(put(scratch_path(s, "fresh"), "new"), OVOID_OK);
    ovoid_remove_temporaries(); /* too late */
    assert_int_equal(scratch_entries(s), 2);
}

static bool refuse(const ovoid_progress *progress, void *user) {
    (void)progress;
    ++*(int *)user;
    return false;
}

/* The last moment to stop is before the file gets its name. */
static void a_stopped_commit_leaves_the_old_file(void **state) {
    scratch *s = *state;
    int asked = 0;
    const char *path = scratch_path(s, "file");
    ovoid_file *file = NULL;
    assert_int_equal(put(path, "old"), OVOID_OK);
    assert_int_equal(ovoid_file_create(context, path, &file), OVOID_OK);
    assert_int_equal(ovoid_file_write(context, file, "new", 3), OVOID_OK);
    ovoid_context_on_progress(context, refuse, &asked);
    assert_int_equal(ovoid_file_commit(context, file), OVOID_ERROR_CANCELLED);
    ovoid_context_on_progress(context, NULL, NULL);
    assert_int_equal(asked, 1);
    assert_int_equal(ovoid_file_commit(context, file), OVOID_ERROR_ARGUMENT);
    ovoid_file_destroy(&file);
    assert_holds(path, "old");
    assert_int_equal(scratch_entries(s), 1);
}

static void link_stays_a_link(void **state) {
    scratch *s = *state;
    const char *target = scratch_path(s, "target"), *link = scratch_path(s, "link");
    struct stat info;
    scratch_write(target, "old", 3);
    assert_int_equal(symlink("target", link), 0);
    assert_int_equal(put(link, "new"), OVOID_OK);
    assert_holds(target, "new");
    assert_int_equal(lstat(link, &info), 0);
    assert_true(S_ISLNK(info.st_mode));
    assert_int_equal(scratch_entries(s), 2);
}

static void dangling_link_gets_its_target(void **state) {
    scratch *s = *state;
    const char *target = scratch_path(s, "target");
    assert_int_equal(symlink("second", scratch_path(s, "first")), 0);
    assert_int_equal(symlink(target, scratch_path(s, "second")), 0);
    assert_int_equal(put(scratch_path(s, "first"), "new"), OVOID_OK);
    assert_holds(target, "new");
    assert_int_equal(scratch_entries(s), 3);
}

static void circle_of_links_fails(void **state) {
    scratch *s = *state;
    assert_int_equal(symlink("two", scratch_path(s, "one")), 0);
    assert_int_equal(symlink("one", scratch_path(s, "two")), 0);
    assert_int_equal(put(scratch_path(s, "one"), "new"), OVOID_ERROR_IO);
    assert_int_equal(ovoid_file_check(context, scratch_path(s, "one")), OVOID_ERROR_IO);
    assert_error("cannot write");
    assert_int_equal(scratch_entries(s), 2);
}

static void missing_folder_is_named(void **state) {
    const char *path = scratch_path(*state, "missing/file");
    assert_int_equal(put(path, "x"), OVOID_ERROR_IO);
    assert_error("there is no folder '");
    assert_error("/missing'");
    assert_int_equal(ovoid_file_check(context, path), OVOID_ERROR_IO);
}

static void folder_in_place_fails(void **state) {
    scratch *s = *state;
    assert_int_equal(put(s->folder, "x"), OVOID_ERROR_IO);
    assert_error("Is a directory");
    assert_int_equal(ovoid_file_check(context, s->folder), OVOID_ERROR_IO);
    assert_int_equal(put("", "x"), OVOID_ERROR_IO);
    assert_error("empty name");
}

static void read_only_places_fail(void **state) {
    scratch *s = *state;
    if (geteuid() == 0) {
        print_message("root may write anywhere\n");
        skip();
    }
    const char *path = scratch_path(s, "file");
    scratch_write(path, "old", 3);
    assert_int_equal(chmod(path, 0444), 0);
    assert_int_equal(put(path, "new"), OVOID_ERROR_IO);
    assert_error("Permission denied");
    assert_int_equal(chmod(s->folder, 0555), 0);
    ovoid_status status = ovoid_file_check(context, scratch_path(s, "new"));
    assert_int_equal(chmod(s->folder, 0755), 0);
    assert_int_equal(status, OVOID_ERROR_IO);
    assert_error("Permission denied");
    assert_holds(path, "old");
}

static void check_changes_nothing(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "file");
    assert_int_equal(ovoid_file_check(context, path), OVOID_OK);
    assert_int_equal(scratch_entries(s), 0);
    scratch_write(path, "old", 3);
    assert_int_equal(ovoid_file_check(context, path), OVOID_OK);
    assert_int_equal(ovoid_file_check(context, "-"), OVOID_OK);
    assert_holds(path, "old");
    assert_int_equal(scratch_entries(s), 1);
}

static void assert_folder(const char *path, const char *wanted) {
    char *folder = NULL;
    assert_int_equal(ovoid_file_folder(context, path, &folder), OVOID_OK);
    assert_string_equal(folder, wanted);
    ovoid_free(folder);
}

static void folder_of_an_output(void **state) {
    scratch *s = *state;
    char *folder = NULL;
    const char *const tmpdir = getenv("TMPDIR");
    char *const before = tmpdir ? strdup(tmpdir) : NULL;
    assert_folder("file", ".");
    assert_folder("folder/file", "folder");
    assert_folder("/file", "/");
    assert_folder(scratch_path(s, "file"), s->folder);
    assert_int_equal(symlink("/usr/file", scratch_path(s, "link")), 0);
    assert_int_equal(symlink("link", scratch_path(s, "further")), 0);
    assert_folder(scratch_path(s, "link"), "/usr");
    assert_folder(scratch_path(s, "further"), "/usr");
    assert_int_equal(setenv("TMPDIR", s->folder, 1), 0);
    assert_folder("-", s->folder);
    assert_folder("/dev/null", s->folder);
    assert_folder("file", ".");
    assert_int_equal(setenv("TMPDIR", scratch_path(s, "missing"), 1), 0);
    assert_folder("/dev/null", "/tmp");
    assert_int_equal(unsetenv("TMPDIR"), 0);
    assert_folder("-", "/tmp");
    if (before)
        assert_int_equal(setenv("TMPDIR", before, 1), 0);
    free(before);
    assert_int_equal(ovoid_file_folder(context, s->folder, &folder), OVOID_ERROR_IO);
    assert_error("Is a directory");
    assert_null(folder);
}

static void full_device_is_reported(void **state) {
    (void)state;
    if (access("/dev/full", W_OK) != 0) {
        print_message("no /dev/full here\n");
        skip();
    }
    assert_int_equal(put("/dev/full", "x"), OVOID_ERROR_IO);
    assert_error("cannot write '/dev/full': No space left on device");
}

static void full_disk_leaves_the_old_file(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "file");
    struct rlimit before, none;
    scratch_write(path, "old", 3);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_IGN);
    none = before;
    none.rlim_cur = 0; /* as a full disk: files open, but take nothing */
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &none), 0);
    ovoid_status status = put(path, "new");
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(status, OVOID_ERROR_IO);
    assert_error("cannot write");
    assert_holds(path, "old");
    assert_int_equal(scratch_entries(s), 1);
}

static void failed_rename_leaves_nothing(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "file");
    ovoid_file *file = NULL;
    assert_int_equal(ovoid_file_create(context, path, &file), OVOID_OK);
    assert_int_equal(mkdir(path, 0755), 0);
    assert_int_equal(ovoid_file_commit(context, file), OVOID_ERROR_IO);
    ovoid_file_destroy(&file);
    assert_int_equal(scratch_entries(s), 1);
}

static void fifo_is_written_in_place(void **state) {
    scratch *s = *state;
    const char *path = scratch_path(s, "fifo");
    char text[8] = "";
    assert_int_equal(mkfifo(path, 0644), 0);
    int reader = open(path, O_RDONLY | O_NONBLOCK);
    assert_true(reader >= 0);
    assert_int_equal(ovoid_file_check(context, path), OVOID_OK);
    assert_int_equal(put(path, "text"), OVOID_OK);
    assert_int_equal(read(reader, text, sizeof text), 4);
    assert_string_equal(text, "text");
    close(reader);
    assert_int_equal(scratch_entries(s), 1);
}

static void null_arguments_are_refused(void **state) {
    (void)state;
    ovoid_file *file = NULL;
    assert_int_equal(ovoid_file_create(context, NULL, &file), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_file_create(context, "x", NULL), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_file_check(context, NULL), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_file_write(context, NULL, "x", 1), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_file_commit(context, NULL), OVOID_ERROR_ARGUMENT);
    ovoid_file_destroy(NULL);
}

#define IN_SCRATCH(test) cmocka_unit_test_setup_teardown(test, scratch_setup, scratch_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        IN_SCRATCH(new_file_gets_the_umask),
        IN_SCRATCH(replaced_file_keeps_its_mode),
        IN_SCRATCH(old_file_stays_until_the_commit),
        IN_SCRATCH(dropped_file_leaves_nothing),
        IN_SCRATCH(temporaries_can_be_removed),
        IN_SCRATCH(nothing_is_left_of_a_commit_that_a_signal_ends),
        IN_SCRATCH(a_stopped_commit_leaves_the_old_file),
        IN_SCRATCH(link_stays_a_link),
        IN_SCRATCH(dangling_link_gets_its_target),
        IN_SCRATCH(circle_of_links_fails),
        IN_SCRATCH(missing_folder_is_named),
        IN_SCRATCH(folder_in_place_fails),
        IN_SCRATCH(read_only_places_fail),
        IN_SCRATCH(folder_of_an_output),
        IN_SCRATCH(check_changes_nothing),
        IN_SCRATCH(full_disk_leaves_the_old_file),
        IN_SCRATCH(failed_rename_leaves_nothing),
        IN_SCRATCH(fifo_is_written_in_place),
        cmocka_unit_test(full_device_is_reported),
        cmocka_unit_test(null_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
