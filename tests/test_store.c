/*
 * Arrays that are kept in files once they are large: the store itself, and meshes in one, which are
 * those in memory.
 */
#define _GNU_SOURCE /* O_TMPFILE */
#include "support.h"

#include "base/store.h"
#include "mesh/exposed.h"
#include "mesh/mesh.h"
#include "scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

enum { LIMIT = 4096, NUMBERS = 100000 };

/* ---- calls that fail ------------------------------------------------------------------------ */

static bool nameless_fail; /* open() of a file without a name, as on some file systems */
static size_t room_calls, room_fails_at;

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? (mode_t)va_arg(arguments, int) : 0;
    va_end(arguments);
    if (nameless_fail && (flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    return __real_open(path, flags, mode);
}

/* The call of this number finds the disk full. */
int __real_posix_fallocate(int file, off_t from, off_t bytes);
int __wrap_posix_fallocate(int file, off_t from, off_t bytes);
int __wrap_posix_fallocate(int file, off_t from, off_t bytes) {
    return ++room_calls == room_fails_at ? ENOSPC : __real_posix_fallocate(file, from, bytes);
}

/* ---- the store ------------------------------------------------------------------------------ */

static ovoid_context *context;
static scratch *place;
static ov_store *store;

static int open_store(void **state) {
    if (scratch_setup(state) != 0)
        return -1;
    place = *state;
    ov_store_limit(LIMIT);
    test_check(NULL, ovoid_context_create(&context));
    test_check(context, ov_store_create(context, place->folder, &store));
    return 0;
}

static int close_store(void **state) {
    ov_store_destroy(&store);
    ov_store_destroy(&store);
    ov_store_limit(0);
    nameless_fail = false;
    room_calls = room_fails_at = 0;
    ovoid_context_destroy(&context);
    return scratch_teardown(state);
}

/* Files of the process in the folder: their names end in "(deleted)". */
static size_t files_of_store(void) {
    char link[512], path[64];
    size_t count = 0;
    DIR *const all = opendir("/proc/self/fd");
    for (const struct dirent *entry; all && (entry = readdir(all)) != NULL;) {
        snprintf(path, sizeof path, "/proc/self/fd/%.20s", entry->d_name);
        const ssize_t length = readlink(path, link, sizeof link - 1);
        link[length > 0 ? length : 0] = '\0';
        count += strncmp(link, place->folder, strlen(place->folder)) == 0;
    }
    if (all)
        closedir(all);
    return count;
}

static void expect_numbers(const uint32_t *numbers, size_t count) {
    for (size_t k = 0; k < count; ++k)
        if (numbers[k] != (uint32_t)(k * 2654435761u))
            fail_msg("number %zu of %zu is another one", k, count);
}

static void grow_by_one(uint32_t **numbers, size_t *capacity, size_t count) {
    test_check(context, ov_store_grow(context, store, numbers, capacity, count + 1,
                                      sizeof **numbers, "numbers"));
    assert_true(*capacity > count);
    (*numbers)[count] = (uint32_t)(count * 2654435761u);
}

/* Two that grow side by side, from memory to files and on. */
static void arrays_keep_what_they_hold(void **state) {
    (void)state;
    uint32_t *one = NULL, *other = NULL;
    size_t room = 0, other_room = 0, grown = 0;
    for (size_t k = 0; k < NUMBERS; ++k) {
        const size_t before = room;
        grow_by_one(&one, &room, k);
        grow_by_one(&other, &other_room, k);
        if (before != room)
            ++grown;
        if (k == LIMIT / 8)
            assert_int_equal(files_of_store(), 0);
        if (k % 1000 == 0)
            ov_store_rest(store);
    }
    assert_true(grown < 60);
    assert_true(room <= NUMBERS + NUMBERS / 4 + 1);
    assert_int_equal(files_of_store(), 2);
    assert_int_equal(scratch_entries(place), 0);
    expect_numbers(one, NUMBERS);
    ov_store_free(store, one);
    assert_int_equal(files_of_store(), 1);
    expect_numbers(other, NUMBERS);
    ov_store_shrink(store, &other, NUMBERS / 2 * sizeof *other);
    ov_store_rest(store);
    expect_numbers(other, NUMBERS / 2);
    ov_store_free(store, other);
    assert_int_equal(files_of_store(), 0);
}

static void new_arrays_are_zero(void **state) {
    (void)state;
    const size_t counts[] = {0, 1, LIMIT / 8, LIMIT / 8 + 1, NUMBERS};
    for (size_t n = 0; n < sizeof counts / sizeof *counts; ++n) {
        uint64_t *made = NULL;
        test_check(context, ov_store_alloc(context, store, &made, counts[n], sizeof *made, "it"));
        assert_int_equal(files_of_store(), counts[n] * sizeof *made > LIMIT);
        for (size_t k = 0; k < counts[n]; ++k)
            assert_int_equal(made[k], 0);
        ov_store_shrink(store, &made, counts[n] / 2 * sizeof *made);
        ov_store_free(store, made);
    }
    ov_store_free(store, NULL);
    uint64_t *none = NULL;
    test_refused(context, ov_store_alloc(context, store, &none, SIZE_MAX / 8, 8, "too many"),
                 OVOID_ERROR_MEMORY, "too many");
}

static void without_a_store_all_is_in_memory(void **state) {
    (void)state;
    uint32_t *numbers = NULL, *zeros = NULL;
    size_t room = 0;
    ov_store *none = NULL;
    test_check(context, ov_store_create(context, NULL, &none));
    assert_null(none);
    test_check(context,
               ov_store_grow(context, none, &numbers, &room, NUMBERS, sizeof *numbers, "numbers"));
    test_check(context, ov_store_alloc(context, none, &zeros, NUMBERS, sizeof *zeros, "zeros"));
    assert_int_equal(zeros[NUMBERS - 1], 0);
    ov_store_shrink(none, &numbers, 10 * sizeof *numbers);
    ov_store_rest(none);
    ov_store_free(none, numbers);
    ov_store_free(none, zeros);
    assert_null(ov_store_share(none));
    ov_store_destroy(&none);
}

/* What nobody freed goes with the last one who keeps the store. */
static void a_store_is_shared(void **state) {
    (void)state;
    uint32_t *numbers = NULL;
    ov_store *other = ov_store_share(store);
    test_check(context,
               ov_store_alloc(context, store, &numbers, NUMBERS, sizeof *numbers, "numbers"));
    ov_store_destroy(&store);
    assert_null(store);
    assert_int_equal(numbers[NUMBERS - 1], 0);
    assert_int_equal(files_of_store(), 1);
    ov_store_destroy(&other);
    assert_int_equal(files_of_store(), 0);
}

/* KiB of this process that are pages of files, or of such in memory. */
static size_t resident_files(void) {
    char line[128];
    size_t sum = 0, kib;
    FILE *const file = fopen("/proc/self/status", "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "RssFile: %zu", &kib) == 1 || sscanf(line, "RssShmem: %zu", &kib) == 1)
            sum += kib;
    fclose(file);
    return sum;
}

static void pages_are_let_go(void **state) {
    (void)state;
    enum { KIB = 1 << 15 };
    unsigned char *bytes = NULL;
    test_check(context, ov_store_alloc(context, store, &bytes, (size_t)KIB << 10, 1, "bytes"));
    const size_t before = resident_files();
    for (size_t k = 0; k < (size_t)KIB << 10; ++k)
        bytes[k] = (unsigned char)(k >> 9);
    assert_true(resident_files() >= before + KIB - 64);
    ov_store_turn(store, OV_STORE_TURN + 1);
    assert_true(resident_files() >= before + KIB - 64);
    ov_store_turn(store, OV_STORE_TURN);
    assert_true(resident_files() <= before + 1024);
    for (size_t k = 0; k < (size_t)KIB << 10; ++k)
        if (bytes[k] != (unsigned char)(k >> 9))
            fail_msg("byte %zu is another one", k);
    ov_store_free(store, bytes);
}

/* Where a file system has no files without a name, they have one for a moment. */
static void files_have_a_name_at_most_for_a_moment(void **state) {
    nameless_fail = true;
    arrays_keep_what_they_hold(state);
    assert_int_equal(scratch_entries(place), 0);
}

static void what_is_no_folder_is_refused(void **state) {
    (void)state;
    ov_store *none = NULL;
    const char *const missing = scratch_path(place, "missing"), *const file =
                                                                    scratch_path(place, "f");
    scratch_write(file, "x", 1);
    test_refused(context, ov_store_create(context, missing, &none), OVOID_ERROR_IO,
                 "there is no folder '");
    test_refused(context, ov_store_create(context, file, &none), OVOID_ERROR_IO, "Not a directory");
    assert_null(none);
}

/* A limit on the length of files stands in for a full disk. */
static void a_folder_without_room_is_an_error(void **state) {
    (void)state;
    uint32_t *numbers = NULL, *more = NULL;
    size_t room = 0;
    struct rlimit old, low;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    low = old;
    low.rlim_cur = 8 * LIMIT;
    void (*const handler)(int) = signal(SIGXFSZ, SIG_IGN);
    for (size_t k = 0; k < LIMIT; ++k)
        grow_by_one(&numbers, &room, k);
    const size_t before = room;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &low), 0);
    const ovoid_status grown =
        ov_store_grow(context, store, &numbers, &room, NUMBERS, sizeof *numbers, "numbers");
    const ovoid_status made =
        ov_store_alloc(context, store, &more, NUMBERS, sizeof *more, "more of them");
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, handler);
    assert_int_equal(grown, OVOID_ERROR_IO);
    test_refused(context, made, OVOID_ERROR_IO, "more of them");
    test_refused(context, made, OVOID_ERROR_IO, place->folder);
    test_refused(context, made, OVOID_ERROR_IO, strerror(EFBIG));
    assert_int_equal(room, before);
    assert_null(more);
    expect_numbers(numbers, LIMIT);
    assert_int_equal(files_of_store(), 1);
    for (size_t k = LIMIT; k < NUMBERS; ++k) /* later there is room */
        grow_by_one(&numbers, &room, k);
    expect_numbers(numbers, NUMBERS);
}

/* ---- meshes --------------------------------------------------------------------------------- */

typedef struct subject {
    ovoid_context *context; /* with the device */
    ovoid_molecule *molecule;
    scratch *place;
} subject;

/* A hollow ball of atoms with a cavity, some of them small, and lone ions about it and in it, which
 * the lattice does not meet or meets badly. */
static ovoid_molecule *make_molecule(ovoid_context *with) {
    enum { SHELL = 160, IONS = 12, ATOMS = SHELL + IONS };
    static double xyzr[4 * ATOMS];
    test_random random = {31};
    ovoid_molecule *molecule = NULL;
    for (size_t i = 0; i < ATOMS; ++i) {
        double *const a = xyzr + 4 * i;
        const bool ion = i >= SHELL;
        const double radius = !ion ? 6.0 : i % 3 == 0 ? 0.0 : 12.0 + (double)(i % 5);
        const double z = 1.0 - 2.0 * ((double)(i % SHELL) + 0.5) / SHELL, turn = 2.4 * (double)i;
        a[0] = sqrt(1.0 - z * z) * cos(turn);
        a[1] = sqrt(1.0 - z * z) * sin(turn);
        a[2] = ion && i % 2 ? -z : z;
        for (int k = 0; k < 3; ++k)
            a[k] = radius * a[k] + random_uniform(&random, -0.2, 0.2) + (ion ? (double)(i % 7) : 0);
        a[3] = ion ? 0.1 + 0.1 * (double)(i % 4) : 1.5;
    }
    test_check(with, ovoid_molecule_create(with, xyzr, ATOMS, &molecule));
    return molecule;
}

static int open_subject(void **state) {
    static subject s;
    void *made = NULL;
    if (test_open(&made) != 0)
        return -1;
    s.context = made;
    if (scratch_setup(&made) != 0)
        return -1;
    s.place = place = made;
    s.molecule = make_molecule(s.context);
    *state = &s;
    return 0;
}

static int close_subject(void **state) {
    subject *const s = *state;
    void *made = s->place;
    ovoid_molecule_destroy(&s->molecule);
    const int left = scratch_teardown(&made);
    made = s->context;
    return test_close(&made) != 0 ? -1 : left;
}

/* limit 0: in memory. */
static ovoid_status make_mesh(const subject *s, size_t limit, double spacing,
                              ovoid_vertex_rule rule, ovoid_mesh **mesh) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    assert_null(options.folder);
    options.vertices = rule;
    options.spacing = test_small() ? 1.0 : spacing;
    options.folder = limit > 0 ? s->place->folder : NULL;
    ov_store_limit(limit);
    const ovoid_status status = once_molecule_mesh(s->context, s->molecule, 0.5, &options, mesh);
    ov_store_limit(0);
    return status;
}

static void expect_same_bytes(const subject *s, const ovoid_mesh *a, const ovoid_mesh *b,
                              const char *extension) {
    char names[2][16];
    struct stat info[2];
    snprintf(names[0], sizeof names[0], "a%s", extension);
    snprintf(names[1], sizeof names[1], "b%s", extension);
    const char *const one = scratch_path(s->place, names[0]), *const other =
                                                                  scratch_path(s->place, names[1]);
    test_check(s->context, ovoid_mesh_write(s->context, a, one));
    test_check(s->context, ovoid_mesh_write(s->context, b, other));
    assert_int_equal(stat(one, &info[0]), 0);
    assert_int_equal(stat(other, &info[1]), 0);
    assert_int_equal(info[0].st_size, info[1].st_size);
    char *const text = scratch_read(one), *const again = scratch_read(other);
    if (memcmp(text, again, (size_t)info[0].st_size) != 0)
        fail_msg("the files %s are not the same", extension);
    free(text);
    free(again);
    unlink(one);
    unlink(other);
}

static void expect_same_meshes(const ovoid_mesh *a, const ovoid_mesh *b) {
    const size_t v = a->vertices, t = a->triangles;
    assert_int_equal(v, b->vertices);
    assert_int_equal(t, b->triangles);
    assert_int_equal(a->components, b->components);
    assert_int_equal(a->missed, b->missed);
    assert_memory_equal(a->xyz, b->xyz, 3 * v * sizeof *a->xyz);
    assert_memory_equal(a->normals, b->normals, 3 * v * sizeof *a->normals);
    assert_memory_equal(a->corners, b->corners, 3 * t * sizeof *a->corners);
    assert_memory_equal(a->edge, b->edge, v);
    assert_memory_equal(a->component_of, b->component_of, v * sizeof *a->component_of);
    for (size_t c = 0; c < a->components; ++c) {
        const ovoid_component *const p = &a->component[c], *const q = &b->component[c];
        assert_int_equal(p->vertices, q->vertices);
        assert_int_equal(p->triangles, q->triangles);
        assert_true(p->area == q->area && p->volume == q->volume);
        assert_int_equal(p->euler, q->euler);
        assert_true(p->closed && q->closed);
        assert_true(p->outer == q->outer && p->exposed == q->exposed);
    }
    assert_true(ovoid_mesh_smooth_area(a) == ovoid_mesh_smooth_area(b));
    assert_true(ovoid_mesh_smooth_volume(a) == ovoid_mesh_smooth_volume(b));
}

/* Specks and cavities are among them, so that all work on meshes is done. */
static void expect_all_kinds(const ovoid_mesh *mesh) {
    size_t cavities = 0, finer = 0;
    for (size_t c = 0; c < mesh->components; ++c)
        cavities += !mesh->component[c].outer;
    for (size_t v = 0; v < mesh->vertices; ++v)
        finer += mesh->edge[v] >> OV_EDGE_AXIS_BITS > 0;
    print_message("%zu vertices, %zu of them of specks; %zu pieces, %zu of them cavities\n",
                  mesh->vertices, finer, mesh->components, cavities);
    assert_true(cavities > 0 && finer > 0 && mesh->components > cavities + 3);
}

/* In a few parts and passes, and in many. */
static void a_mesh_is_the_same_in_files(void **state) {
    static const char *const extensions[] = {".ply", ".obj", ".stl", ".off", ".glb"};
    static const struct {
        size_t limit;
        double spacing;
        ovoid_vertex_rule rule;
    } cases[] = {{64, 0.5, OVOID_VERTEX_EXACT},
                 {64, 0.5, OVOID_VERTEX_LINEAR},
                 {LIMIT, 0.12, OVOID_VERTEX_EXACT},
                 {LIMIT, 0.3, OVOID_VERTEX_LINEAR}};
    const subject *const s = *state;
    test_skip_simulated(s->context);
    for (size_t n = 0; n < sizeof cases / sizeof *cases; ++n) {
        const double h = cases[n].spacing;
        ovoid_mesh *mesh = NULL, *kept = NULL;
        test_check(s->context, make_mesh(s, 0, h, cases[n].rule, &mesh));
        assert_int_equal(files_of_store(), 0);
        test_check(s->context, make_mesh(s, cases[n].limit, h, cases[n].rule, &kept));
        assert_true(files_of_store() >= 5); /* xyz, normals, corners, edges, components */
        assert_int_equal(scratch_entries(s->place), 0);
        expect_all_kinds(mesh);
        expect_same_meshes(mesh, kept);
        for (size_t k = 0; k < sizeof extensions / sizeof *extensions; ++k)
            expect_same_bytes(s, mesh, kept, extensions[k]);
        ovoid_mesh_destroy(&mesh);
        ovoid_mesh_destroy(&kept);
        assert_int_equal(files_of_store(), 0);
    }
}

/* The pairs that were found, in whatever order. */
typedef struct pairs {
    size_t count;
    uint64_t sum;
} pairs;

static ovoid_status add_pair(uint32_t v, uint32_t w, void *user) {
    pairs *const p = user;
    const uint32_t both[2] = {v, w};
    ++p->count;
    p->sum += ov_hash(both, sizeof both);
    return OVOID_OK;
}

static pairs find_pairs(const subject *s, const ovoid_mesh *mesh, double reach) {
    uint32_t *const set_of = test_alloc(mesh->vertices, sizeof *set_of);
    pairs found = {0, 0};
    for (size_t v = 0; v < mesh->vertices; ++v)
        set_of[v] = v % 11 == 0 ? OV_NO_SET : (uint32_t)(v / 7 % 5 / 2);
    test_check(s->context, ov_mesh_near_sets(s->context, mesh, set_of, 3, reach, add_pair, &found));
    free(set_of);
    return found;
}

/* Slab by slab as all at once, where sets meet everywhere. */
static void neighbours_are_the_same_in_files(void **state) {
    const subject *const s = *state;
    ovoid_mesh *mesh = NULL, *kept = NULL;
    test_skip_simulated(s->context);
    test_check(s->context, make_mesh(s, 0, 0.5, OVOID_VERTEX_EXACT, &mesh));
    test_check(s->context, make_mesh(s, 64, 0.5, OVOID_VERTEX_EXACT, &kept));
    for (double reach = 0.02; reach < 20.0; reach *= 7.0) {
        const pairs all = find_pairs(s, mesh, reach), same = find_pairs(s, kept, reach);
        print_message("%zu pairs within %g angstrom\n", all.count, reach);
        assert_true(all.count > 0);
        assert_int_equal(all.count, same.count);
        assert_true(all.sum == same.sum);
    }
    ovoid_mesh_destroy(&mesh);
    ovoid_mesh_destroy(&kept);
}

/* Each time that room is asked for, there is none once. */
static void a_full_disk_at_any_time_is_an_error(void **state) {
    const subject *const s = *state;
    size_t failures = 0;
    ovoid_status status = OVOID_ERROR_IO;
    test_skip_simulated(s->context);
    for (size_t at = 1; status != OVOID_OK; at += test_small() ? 7 : 1) {
        ovoid_mesh *mesh = NULL;
        room_calls = 0;
        room_fails_at = at;
        status = make_mesh(s, 1024, 0.5, OVOID_VERTEX_EXACT, &mesh);
        if (status != OVOID_OK) {
            test_refused(s->context, status, OVOID_ERROR_IO, "No space left on device");
            test_refused(s->context, status, OVOID_ERROR_IO, s->place->folder);
            assert_null(mesh);
            ++failures;
        }
        ovoid_mesh_destroy(&mesh);
        assert_int_equal(files_of_store(), 0);
    }
    room_fails_at = 0;
    print_message("%zu failures\n", failures);
    assert_true(failures > (test_small() ? 2 : 20));
}

static void a_folder_that_is_not_there_is_an_error(void **state) {
    const subject *const s = *state;
    ovoid_mesh_options options;
    ovoid_mesh *mesh = NULL;
    ovoid_mesh_options_init(&options, sizeof options);
    options.folder = scratch_path(s->place, "missing");
    test_refused(s->context, once_molecule_mesh(s->context, s->molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_IO, "there is no folder '");
    assert_null(mesh);
}

int main(void) {
#define STORE(test) cmocka_unit_test_setup_teardown(test, open_store, close_store)
    const struct CMUnitTest stores[] = {
        STORE(arrays_keep_what_they_hold),
        STORE(new_arrays_are_zero),
        STORE(without_a_store_all_is_in_memory),
        STORE(a_store_is_shared),
        STORE(pages_are_let_go),
        STORE(files_have_a_name_at_most_for_a_moment),
        STORE(what_is_no_folder_is_refused),
        STORE(a_folder_without_room_is_an_error),
    };
    const struct CMUnitTest meshes[] = {
        cmocka_unit_test(a_mesh_is_the_same_in_files),
        cmocka_unit_test(neighbours_are_the_same_in_files),
        cmocka_unit_test(a_full_disk_at_any_time_is_an_error),
        cmocka_unit_test(a_folder_that_is_not_there_is_an_error),
    };
    const int failed = cmocka_run_group_tests(stores, NULL, NULL);
    return failed + cmocka_run_group_tests(meshes, open_subject, close_subject);
}
