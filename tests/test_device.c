/*
 * The device room: finding and choosing devices, programs and their cache, launches, buffers. Cases
 * that depend on how the process started run in a child: this program with the argument "child".
 */
#define _XOPEN_SOURCE 700 /* nftw */

#include "device/internal.h"
#include "selftest/check.h"

#include "shared.h"

#include <ctype.h>
#include <dirent.h>
#include <ftw.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#define PATH_SIZE 512

static char scratch[PATH_SIZE - 128]; /* a folder of this run */
static const char *self;

/* ---- helpers ------------------------------------------------------------------------------ */

static const char *in_scratch(const char *name) {
    static char paths[8][PATH_SIZE];
    static int next;
    char *path = paths[next++ % 8];
    snprintf(path, PATH_SIZE, "%s/%s", scratch, name);
    return path;
}

static void write_file(const char *path, const void *bytes, size_t count) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
}

static void write_text(const char *path, const char *text) {
    write_file(path, text, strlen(text));
}

static void read_file(const char *path, ov_text *text) {
    assert_int_equal(ov_text_read(NULL, text, path), OVOID_OK);
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *where) {
    (void)info, (void)kind, (void)where;
    return remove(path);
}

static void remove_tree(const char *path) {
    nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

/* Number of files in a folder, 0 if there is none; path of the last in *path (PATH_SIZE). */
static int list_files(const char *folder, char *path) {
    int count = 0;
    DIR *directory = opendir(folder);
    struct dirent *entry;
    while (directory && (entry = readdir(directory))) {
        if (entry->d_name[0] == '.')
            continue;
        count++;
        if (path)
            snprintf(path, PATH_SIZE, "%s/%.200s", folder, entry->d_name);
    }
    if (directory)
        closedir(directory);
    return count;
}

static void assert_contains(const char *text, const char *part) {
    if (!strstr(text, part))
        fail_msg("\"%s\" is missing in \"%s\"", part, text);
}

static void assert_lacks(const char *text, const char *part) {
    if (strstr(text, part))
        fail_msg("\"%s\" is unexpected in \"%s\"", part, text);
}

typedef struct warnings {
    int count;
    char last[1024];
} warnings;

static void keep_warning(const char *text, void *user) {
    warnings *kept = user;
    kept->count++;
    snprintf(kept->last, sizeof kept->last, "%s", text);
}

static ovoid_context *open_context(void) {
    ovoid_context *context = NULL;
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    ovoid_status status = ovoid_context_open_device(context, NULL);
    if (status != OVOID_OK)
        fail_msg("%s", ovoid_context_error(context));
    return context;
}

static void check(ovoid_context *context, ovoid_status status) {
    if (status != OVOID_OK)
        fail_msg("%s: %s", ovoid_status_name(status), ovoid_context_error(context));
}

/* Makes a kernel folder with the files all programs share and with one program; points
 * OVOID_KERNEL_DIR to it. */
static void use_kernels(const char *program, const char *text) {
    char name[128];
    mkdir(in_scratch("kernels"), 0700);
    for (const ov_source *source = ov_sources; source->name; source++) {
        if (strcmp(strrchr(source->name, '.'), ".cl") == 0)
            continue;
        snprintf(name, sizeof name, "kernels/%.100s", source->name);
        write_text(in_scratch(name), source->text);
    }
    snprintf(name, sizeof name, "kernels/%.100s.cl", program);
    write_text(in_scratch(name), text);
    setenv("OVOID_KERNEL_DIR", in_scratch("kernels"), 1);
}

static const char fill_source[] = "kernel void fill(global uint *out, uint count, uint first) {\n"
                                  "    const uint i = get_global_id(0);\n"
                                  "    if (i < count)\n"
                                  "        out[i] = first + i;\n"
                                  "    if (i == 0)\n"
                                  "        out[count] = get_global_size(0);\n"
                                  "}\n"
                                  "kernel void total(global uint *out, local uint *part) {\n"
                                  "    const uint i = get_local_id(0);\n"
                                  "    part[i] = i + 1;\n"
                                  "    barrier(CLK_LOCAL_MEM_FENCE);\n"
                                  "    uint sum = 0;\n"
                                  "    for (uint k = 0; k < get_local_size(0); k++)\n"
                                  "        sum += part[k];\n"
                                  "    out[i] = sum;\n"
                                  "}\n"
                                  "__attribute__((reqd_work_group_size(4, 1, 1)))\n"
                                  "kernel void four(global uint *out) {\n"
                                  "    out[0] = get_local_size(0);\n"
                                  "}\n";

/* Runs `fill` of program "fill" over 100 values and checks them. */
static void run_fill(ovoid_context *context, uint32_t first) {
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t count = 100, out[101];
    check(context, ov_kernel_create(context, "fill", "fill", &kernel));
    check(context, ov_buffer_reserve(context, &buffer, sizeof out, "test values"));
    check(context, OV_LAUNCH(context, &kernel, count, 16, OV_ARG(buffer.memory), OV_ARG(count),
                             OV_ARG(first)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    for (uint32_t i = 0; i < count; i++)
        assert_int_equal(out[i], first + i);
    assert_int_equal(out[count], 112); /* rounded up to groups of 16 */
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
}

/* Skips a test on a platform that cannot run it. */
static void skip_on(const char *platform, const char *reason) {
    ovoid_context *context = open_context();
    bool same = strcmp(ovoid_context_device(context)->platform, platform) == 0;
    ovoid_context_destroy(&context);
    if (same) {
        print_message("skipped on %s: %s\n", platform, reason);
        skip();
    }
}

static int clear_environment(void **state) {
    static const char *const names[] = {"OVOID_KERNEL_DIR", "OVOID_SHAPE", "OVOID_CACHE_DIR"};
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        unsetenv(names[i]);
    setenv("OVOID_CACHE", "off", 1);
    return 0;
}

/* ---- errors ------------------------------------------------------------------------------- */

static void test_error_names(void **state) {
    (void)state;
    assert_string_equal(ov_cl_name(CL_SUCCESS), "CL_SUCCESS");
    assert_string_equal(ov_cl_name(-5), "CL_OUT_OF_RESOURCES");
    assert_string_equal(ov_cl_name(-54), "CL_INVALID_WORK_GROUP_SIZE");
    assert_string_equal(ov_cl_name(-1001), "CL_PLATFORM_NOT_FOUND_KHR");
    assert_string_equal(ov_cl_name(12345), "unknown OpenCL error");
    for (cl_int code = -68; code <= 0; code++) {
        if (code < -19 && code > -30)
            continue; /* never assigned */
        assert_string_not_equal(ov_cl_name(code), "unknown OpenCL error");
        for (cl_int other = -68; other < code; other++)
            if (other >= -19 || other <= -30)
                assert_string_not_equal(ov_cl_name(code), ov_cl_name(other));
    }
}

static void test_error_text(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    const char *device = ovoid_context_device(context)->name;
    char wanted[512];
    assert_int_equal(ov_cl_fail(context, CL_OUT_OF_RESOURCES, "clFoo", "field"),
                     OVOID_ERROR_OPENCL);
    snprintf(wanted, sizeof wanted, "clFoo: CL_OUT_OF_RESOURCES (-5), kernel field, device %s",
             device);
    assert_string_equal(ovoid_context_error(context), wanted);
    assert_int_equal(ov_cl_fail(context, CL_OUT_OF_HOST_MEMORY, "clFoo", NULL), OVOID_ERROR_MEMORY);
    snprintf(wanted, sizeof wanted, "clFoo: CL_OUT_OF_HOST_MEMORY (-6), device %s", device);
    assert_string_equal(ovoid_context_error(context), wanted);
    assert_int_equal(ov_cl_fail(context, CL_MEM_OBJECT_ALLOCATION_FAILURE, "clFoo", NULL),
                     OVOID_ERROR_MEMORY);
    ovoid_context_destroy(&context);
}

/* ---- finding and choosing ----------------------------------------------------------------- */

static void test_list(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    ovoid_device_info *devices = NULL;
    size_t count = 0;
    assert_int_equal(ovoid_devices(NULL, sizeof(ovoid_device_info), &devices, &count),
                     OVOID_ERROR_ARGUMENT);
    check(context, ovoid_context_create(&context));
    assert_int_equal(ovoid_devices(context, sizeof(ovoid_device_info), NULL, &count),
                     OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_devices(context, sizeof(ovoid_device_info), &devices, NULL),
                     OVOID_ERROR_ARGUMENT);
    check(context, ovoid_devices(context, sizeof(ovoid_device_info), &devices, &count));
    assert_true(count > 0);
    for (size_t i = 0; i < count; i++) {
        assert_int_equal(devices[i].index, i);
        assert_true(devices[i].name[0] && devices[i].platform[0] && devices[i].driver[0]);
        assert_memory_equal(devices[i].opencl, "OpenCL ", 7);
        assert_true(devices[i].compute_units > 0);
        assert_true(devices[i].float_width > 0);
        assert_true(devices[i].max_allocation > 0);
        assert_true(devices[i].global_memory >= devices[i].max_allocation);
    }
    assert_null(ovoid_context_device(context)); /* listing opens nothing */
    assert_null(ovoid_context_device(NULL));
    ovoid_free(devices);
    ovoid_context_destroy(&context);
}

static void test_selectors(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    ov_device_entry *entries = NULL;
    size_t count, platforms;
    check(context, ovoid_context_create(&context));
    check(context, ov_devices_list(context, &entries, &count, &platforms));
    for (size_t i = 0; i < count; i++) {
        const ovoid_device_info *info = &entries[i].info;
        char text[160];
        if (entries[i].defect[0])
            continue;
        snprintf(text, sizeof text, "%zu", i);
        check(context, ovoid_context_open_device(context, text));
        assert_int_equal(ovoid_context_device(context)->index, i);

        snprintf(text, sizeof text, "%.12s", info->name);
        for (char *c = text; *c; c++)
            *c = (char)(isupper((unsigned char)*c) ? tolower(*c) : toupper(*c));
        check(context, ovoid_context_open_device(context, text));
        assert_memory_equal(ovoid_context_device(context)->name, info->name, strlen(text));

        check(context, ovoid_context_open_device(context, info->platform));
        assert_string_equal(ovoid_context_device(context)->platform, info->platform);

        check(context, ovoid_context_open_device(context, ov_device_type_name(info->type)));
        assert_int_equal(ovoid_context_device(context)->type, info->type);
    }
    free(entries);
    ovoid_context_destroy(&context);
}

static void test_selector_environment(void **state) {
    (void)state;
    const char *old = getenv("OVOID_DEVICE");
    char *kept = old ? strdup(old) : NULL;
    ovoid_context *context = open_context();
    char index[16];
    snprintf(index, sizeof index, "%u", (unsigned)ovoid_context_device(context)->index);
    setenv("OVOID_DEVICE", "no such device", 1);
    assert_int_equal(ovoid_context_open_device(context, NULL), OVOID_ERROR_DEVICE);
    assert_contains(ovoid_context_error(context), "\"no such device\" (from OVOID_DEVICE)");
    assert_int_equal(ovoid_context_open_device(context, ""), OVOID_ERROR_DEVICE);
    check(context, ovoid_context_open_device(context, index)); /* the argument comes first */
    setenv("OVOID_DEVICE", index, 1);
    check(context, ovoid_context_open_device(context, ""));
    setenv("OVOID_DEVICE", "", 1);
    check(context, ovoid_context_open_device(context, NULL));
    if (kept)
        setenv("OVOID_DEVICE", kept, 1);
    else
        unsetenv("OVOID_DEVICE");
    free(kept);
    ovoid_context_destroy(&context);
}

static void test_bad_selector(void **state) {
    (void)state;
    static const char *const bad[] = {
        "no such device", "4711", "18446744073709551616", "0x0", "-1", "0 "};
    ovoid_context *context = open_context();
    const ovoid_device_info *before = ovoid_context_device(context);
    ovoid_device_info *devices;
    size_t count;
    check(context, ovoid_devices(context, sizeof(ovoid_device_info), &devices, &count));
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(ovoid_context_open_device(context, bad[i]), OVOID_ERROR_DEVICE);
        assert_contains(ovoid_context_error(context), bad[i]);
        for (size_t k = 0; k < count; k++)
            assert_contains(ovoid_context_error(context), devices[k].name);
        assert_lacks(ovoid_context_error(context), "OVOID_DEVICE");
    }
    assert_ptr_equal(ovoid_context_device(context), before); /* the open one stays */
    ovoid_free(devices);
    ovoid_context_destroy(&context);
    assert_int_equal(ovoid_context_open_device(NULL, NULL), OVOID_ERROR_ARGUMENT);
}

static void test_shape(void **state) {
    (void)state;
    static const char *const bad[] = {"2x4",   "3x1",   "16x4",    "x",           "1x",  "1x3",
                                      "1x16x", "-1x1",  "1x32",    "0x1",         "1x0", " 1x1",
                                      "4",     "1 x 1", "99999x1", "4294967297x1"};
    ovoid_context *context = open_context();
    ov_shape shape = context->device->shape;
    assert_int_equal(OV_PACK % (shape.vector * shape.lanes), 0);
    if (context->device->info.type == OVOID_DEVICE_GPU) {
        assert_int_equal(shape.vector, 1);
        assert_int_equal(shape.lanes, OV_PACK);
    } else {
        assert_int_equal(shape.lanes, 1);
        assert_true(shape.vector <= (context->device->info.float_width | 1));
        assert_true(shape.vector > context->device->info.float_width / 4 || shape.vector == 16);
    }
    setenv("OVOID_SHAPE", "1x16", 1);
    check(context, ovoid_context_open_device(context, NULL));
    assert_int_equal(context->device->shape.vector, 1);
    assert_int_equal(context->device->shape.lanes, 16);
    setenv("OVOID_SHAPE", "4x1", 1);
    check(context, ovoid_context_open_device(context, NULL));
    assert_int_equal(context->device->shape.vector, 4);
    assert_int_equal(context->device->shape.lanes, 1);

    use_kernels("shape", "kernel void shape(global uint *out) {\n"
                         "    out[0] = OV_VECTOR, out[1] = OV_LANES, out[2] = OV_PACK;\n"
                         "}\n");
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t out[3];
    check(context, ov_kernel_create(context, "shape", "shape", &kernel));
    check(context, ov_buffer_reserve(context, &buffer, sizeof out, "shape"));
    check(context, OV_LAUNCH(context, &kernel, 1, 0, OV_ARG(buffer.memory)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[0], 4);
    assert_int_equal(out[1], 1);
    assert_int_equal(out[2], OV_PACK);
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);

    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        setenv("OVOID_SHAPE", bad[i], 1);
        if (ovoid_context_open_device(context, NULL) != OVOID_ERROR_ARGUMENT)
            fail_msg("OVOID_SHAPE=%s was taken", bad[i]);
        assert_contains(ovoid_context_error(context), "OVOID_SHAPE");
    }
    setenv("OVOID_SHAPE", "", 1);
    check(context, ovoid_context_open_device(context, NULL));
    assert_int_equal(context->device->shape.vector, shape.vector);
    ovoid_context_destroy(&context);
}

/* ---- programs ----------------------------------------------------------------------------- */

static void test_embedded(void **state) {
    (void)state;
    size_t count = 0;
    for (const ov_source *source = ov_sources; source->name; source++, count++) {
        char path[PATH_SIZE];
        ov_text text = {0};
        snprintf(path, sizeof path, "%s/%s", OVOID_KERNELS, source->name);
        read_file(path, &text);
        assert_string_equal(source->text, text.text);
        assert_int_equal(strlen(source->text), text.length);
        free(text.text);
    }
    assert_true(count >= 3);
}

static void test_layout(void **state) {
    (void)state;
    uint32_t host[OV_LAYOUT_MOST];
    const size_t count = ov_layout_of_host(host);
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t out[64];
    memset(out, 0xff, sizeof out);
    check(context, ov_kernel_create(context, "layout", "layout", &kernel));
    check(context, ov_buffer_reserve(context, &buffer, sizeof out, "layout"));
    check(context, ov_buffer_write(context, &buffer, 0, out, sizeof out));
    check(context, OV_LAUNCH(context, &kernel, 1, 0, OV_ARG(buffer.memory)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    for (size_t i = 0; i < count; i++)
        assert_int_equal(out[i], host[i]);
    assert_int_equal(out[count], 0xffffffffu); /* and no more than these */
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
}

static void test_build_failure(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    use_kernels("fill", "kernel void fill(global uint *out) {\n    out[0] = no_such_name;\n}\n");
    assert_int_equal(ov_kernel_create(context, "fill", "fill", &kernel), OVOID_ERROR_OPENCL);
    const char *text = ovoid_context_error(context);
    assert_contains(text, "clBuildProgram: ");
    assert_contains(text, "fill.cl");
    assert_contains(text, "-cl-std=CL1.2 -DOV_VECTOR=");
    assert_contains(text, ovoid_context_device(context)->name);
    assert_contains(text, "no_such_name"); /* the log */
    assert_lacks(text, "relaxed");
    assert_lacks(text, "fast");
    assert_null(kernel.handle);

    use_kernels("fill", fill_source); /* a mended source is tried anew */
    run_fill(context, 7);
    ovoid_context_destroy(&context);
}

static void test_long_build_log(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    ov_text source = {0};
    for (int i = 0; i < 15; i++)
        check(NULL,
              ov_text_print(NULL, &source, "constant int bad_%d = missing_%d_%0200d;\n", i, i, i));
    use_kernels("fill", source.text);
    assert_int_equal(ov_kernel_create(context, "fill", "fill", &kernel), OVOID_ERROR_OPENCL);
    assert_contains(ovoid_context_error(context), "missing_0_");
    assert_contains(ovoid_context_error(context), "missing_14_");
    free(source.text);
    ovoid_context_destroy(&context);
}

static void test_missing_programs(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    assert_int_equal(ov_kernel_create(context, "no_such_program", "field", &kernel),
                     OVOID_ERROR_ARGUMENT);
    assert_contains(ovoid_context_error(context), "no_such_program.cl");
    assert_int_equal(ov_kernel_create(context, "layout", "no_such_kernel", &kernel),
                     OVOID_ERROR_OPENCL);
    assert_contains(ovoid_context_error(context), "clCreateKernel: CL_INVALID_KERNEL_NAME (-46)");
    assert_contains(ovoid_context_error(context), "kernel no_such_kernel of layout.cl");
    setenv("OVOID_KERNEL_DIR", in_scratch("nowhere"), 1);
    assert_int_equal(ov_kernel_create(context, "fill", "fill", &kernel), OVOID_ERROR_IO);
    assert_contains(ovoid_context_error(context), in_scratch("nowhere/shared.h"));
    use_kernels("fill", fill_source);
    remove(in_scratch("kernels/fill.cl"));
    mkdir(in_scratch("kernels/fill.cl"), 0700);
    assert_int_equal(ov_kernel_create(context, "fill", "fill", &kernel), OVOID_ERROR_IO);
    assert_contains(ovoid_context_error(context), in_scratch("kernels/fill.cl"));
    rmdir(in_scratch("kernels/fill.cl"));
    assert_null(kernel.handle);
    ovoid_context_destroy(&context);
}

static void test_program_built_once(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    use_kernels("fill", fill_source);
    run_fill(context, 1);
    run_fill(context, 2);
    check(context, ov_kernel_create(context, "fill", "total", &kernel));
    assert_int_equal(context->device->built, 1);
    ov_kernel_destroy(&kernel);
    ov_kernel_destroy(&kernel);
    ov_kernel_destroy(NULL);
    ovoid_context_destroy(&context);
}

/* Kernels of two files. PoCL is given all files as one program unless programs are to be kept. */
static void test_programs_of_files(void **state) {
    (void)state;
    ov_kernel one = {0}, other = {0};
    for (int kept = 0; kept < 2; kept++) {
        setenv("OVOID_CACHE", kept ? "on" : "off", 1);
        setenv("OVOID_CACHE_DIR", in_scratch("files"), 1);
        ovoid_context *context = open_context();
        bool pocl = strcmp(ovoid_context_device(context)->platform, OV_POCL_PLATFORM) == 0;
        check(context, ov_kernel_create(context, "layout", "layout", &one));
        check(context, ov_kernel_create(context, "residual", "residual", &other));
        assert_int_equal(context->device->built, pocl && !kept ? 1 : 2);
        assert_int_equal(list_files(in_scratch("files"), NULL), kept ? 2 : 0);
        use_kernels("layout", fill_source); /* a source elsewhere is a program of its own */
        ov_kernel_destroy(&one);
        if (pocl && !kept) {
            check(context, ov_kernel_create(context, "layout", "fill", &one));
            assert_int_equal(context->device->built, 2);
            ov_kernel_destroy(&one);
        }
        unsetenv("OVOID_KERNEL_DIR");
        ov_kernel_destroy(&other);
        ovoid_context_destroy(&context);
    }
}

/* ---- cache -------------------------------------------------------------------------------- */

/* Runs `fill` in a context of its own; whether its program came from the cache. */
static bool filled_from_cache(warnings *kept) {
    ovoid_context *context = open_context();
    if (kept)
        ovoid_context_on_warning(context, keep_warning, kept);
    run_fill(context, 3);
    assert_int_equal(context->device->built + context->device->loaded, 1);
    bool loaded = context->device->loaded == 1;
    ovoid_context_destroy(&context);
    return loaded;
}

static void use_cache(const char *folder) {
    use_kernels("fill", fill_source);
    setenv("OVOID_CACHE", "on", 1);
    setenv("OVOID_CACHE_DIR", in_scratch(folder), 1);
}

static void test_cache(void **state) {
    (void)state;
    warnings kept = {0};
    char path[PATH_SIZE];
    struct stat info;
    use_cache("cold/deep");
    assert_false(filled_from_cache(&kept));
    assert_int_equal(list_files(in_scratch("cold/deep"), path), 1); /* and nothing temporary */
    assert_int_equal(stat(in_scratch("cold/deep"), &info), 0);
    assert_int_equal(info.st_mode & 0777, 0700);
    assert_true(filled_from_cache(&kept));
    assert_int_equal(list_files(in_scratch("cold/deep"), path), 1);
    assert_int_equal(kept.count, 0);

    setenv("OVOID_CACHE", "off", 1);
    assert_false(filled_from_cache(NULL));
}

static void test_cache_damage(void **state) {
    (void)state;
    char path[PATH_SIZE];
    ov_text whole = {0};
    use_cache("damage");
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("damage"), path), 1);
    read_file(path, &whole);
    const size_t places[] = {0, 20, 70, whole.length / 2, whole.length - 1};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        whole.text[places[i]] ^= 1;
        write_file(path, whole.text, whole.length);
        whole.text[places[i]] ^= 1;
        assert_false(filled_from_cache(NULL)); /* ignored and written anew */
        assert_true(filled_from_cache(NULL));
    }
    const size_t lengths[] = {0, 1, 66, 67, 100, whole.length - 1};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
        write_file(path, whole.text, lengths[i]);
        assert_false(filled_from_cache(NULL));
        assert_true(filled_from_cache(NULL));
    }
    check(NULL, ov_text_append(NULL, &whole, "x", 1)); /* too long */
    write_file(path, whole.text, whole.length);
    assert_false(filled_from_cache(NULL));
    assert_true(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("damage"), path), 1);
    free(whole.text);
}

/* A whole file whose binary the driver does not take. */
static void test_cache_refused(void **state) {
    (void)state;
    skip_on("rusticl", "it aborts on a binary that is none");
    char path[PATH_SIZE];
    ov_text whole = {0}, key = {0};
    unsigned long long key_length = 0;
    static const unsigned char junk[] = "this is no program";
    use_cache("refused");
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("refused"), path), 1);
    read_file(path, &whole);
    assert_int_equal(sscanf(whole.text, "ovoid program 1 %16llx", &key_length), 1);
    check(NULL, ov_text_append(NULL, &key, strchr(whole.text, '\n') + 1, (size_t)key_length));
    ovoid_context *context = open_context();
    ov_cache_write(context, context->device, "fill", &key, junk, sizeof junk);
    ovoid_context_destroy(&context);
    ov_text binary = {0};
    assert_true(ov_cache_read("fill", &key, &binary)); /* it did go where the program is read */
    assert_int_equal(binary.length, sizeof junk);
    assert_memory_equal(binary.text, junk, sizeof junk);
    assert_false(filled_from_cache(NULL));
    assert_true(filled_from_cache(NULL));
    free(binary.text);
    free(whole.text);
    free(key.text);
}

static void test_cache_key(void **state) {
    (void)state;
    char path[PATH_SIZE], other[PATH_SIZE];
    use_cache("key");
    setenv("OVOID_SHAPE", "4x1", 1);
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("key"), path), 1);
    setenv("OVOID_SHAPE", "1x16", 1); /* other options */
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("key"), NULL), 2);

    char changed[sizeof fill_source + 32];
    snprintf(changed, sizeof changed, "%s/* changed */\n", fill_source);
    use_kernels("fill", changed); /* another source */
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("key"), NULL), 3);
    assert_true(filled_from_cache(NULL));
    use_kernels("fill", fill_source);
    assert_true(filled_from_cache(NULL));
    setenv("OVOID_SHAPE", "4x1", 1);
    assert_true(filled_from_cache(NULL));

    /* A hash that collides: another program's file in this one's place is not taken. */
    ov_text whole = {0}, key = {0}, binary = {0};
    check(NULL, ov_text_print(NULL, &key, "some other key"));
    assert_false(ov_cache_read("fill", &key, &binary));
    ovoid_context *context = open_context();
    setenv("OVOID_CACHE_DIR", in_scratch("other"), 1);
    ov_cache_write(context, context->device, "fill", &key, (const unsigned char *)"abc", 3);
    ovoid_context_destroy(&context);
    assert_true(ov_cache_read("fill", &key, &binary));
    assert_string_equal(binary.text, "abc");
    assert_int_equal(list_files(in_scratch("other"), other), 1);
    read_file(other, &whole);
    write_file(path, whole.text, whole.length);
    setenv("OVOID_CACHE_DIR", in_scratch("key"), 1);
    assert_false(filled_from_cache(NULL));
    assert_true(filled_from_cache(NULL));
    free(whole.text);
    free(key.text);
    free(binary.text);
}

static void test_cache_unwritable(void **state) {
    (void)state;
    warnings kept = {0};
    ov_kernel kernel = {0};
    use_cache("file/below");
    write_text(in_scratch("file"), "a file, not a folder");
    ovoid_context *context = open_context();
    ovoid_context_on_warning(context, keep_warning, &kept);
    run_fill(context, 1);
    unsetenv("OVOID_KERNEL_DIR");
    check(context, ov_kernel_create(context, "layout", "layout", &kernel));
    assert_int_equal(context->device->built, 2);
    assert_int_equal(kept.count, 1); /* for both programs */
    assert_contains(kept.last, in_scratch("file/below"));
    ov_kernel_destroy(&kernel);
    ovoid_context_destroy(&context);

    use_cache("ghost"); /* a folder in the way of the file */
    char path[PATH_SIZE];
    assert_false(filled_from_cache(NULL));
    assert_int_equal(list_files(in_scratch("ghost"), path), 1);
    remove(path);
    mkdir(path, 0700);
    memset(&kept, 0, sizeof kept);
    assert_false(filled_from_cache(&kept));
    assert_int_equal(kept.count, 1);
    assert_int_equal(list_files(in_scratch("ghost"), NULL), 1);
}

static void test_cache_folder(void **state) {
    (void)state;
    const char *names[] = {"HOME", "XDG_CACHE_HOME"};
    char *kept[2];
    warnings told = {0};
    for (int i = 0; i < 2; i++)
        kept[i] = getenv(names[i]) ? strdup(getenv(names[i])) : NULL;
    use_cache("unused");
    setenv("OVOID_CACHE_DIR", "", 1);
    setenv("HOME", in_scratch("home"), 1);
    setenv("XDG_CACHE_HOME", in_scratch("xdg"), 1);
    assert_false(filled_from_cache(&told));
    assert_int_equal(list_files(in_scratch("xdg/ovoid"), NULL), 1);
    assert_int_equal(list_files(in_scratch("home/.cache/ovoid"), NULL), 0);
    setenv("XDG_CACHE_HOME", "relative", 1);
    assert_false(filled_from_cache(&told));
    assert_int_equal(list_files(in_scratch("home/.cache/ovoid"), NULL), 1);
    unsetenv("XDG_CACHE_HOME");
    assert_true(filled_from_cache(&told));
    assert_int_equal(told.count, 0);
    unsetenv("HOME");
    assert_false(filled_from_cache(&told));
    assert_int_equal(told.count, 1);
    for (int i = 0; i < 2; i++) {
        if (kept[i])
            setenv(names[i], kept[i], 1);
        free(kept[i]);
    }
}

static void test_cache_modes(void **state) {
    (void)state;
    warnings kept = {0};
    use_cache("modes");
    ovoid_context *context = open_context();
    ov_device device = *context->device;
    setenv("OVOID_CACHE", "auto", 1);
    snprintf(device.info.platform, sizeof device.info.platform, "%s", OV_POCL_PLATFORM);
    assert_false(ov_cache_wanted(context, &device)); /* PoCL keeps them itself */
    snprintf(device.info.platform, sizeof device.info.platform, "Some Platform");
    assert_true(ov_cache_wanted(context, &device));
    unsetenv("OVOID_CACHE");
    assert_true(ov_cache_wanted(context, &device));
    setenv("OVOID_CACHE", "off", 1);
    assert_false(ov_cache_wanted(context, &device));
    ovoid_context_on_warning(context, keep_warning, &kept);
    setenv("OVOID_CACHE", "maybe", 1);
    assert_true(ov_cache_wanted(context, &device));
    assert_int_equal(kept.count, 1);
    assert_contains(kept.last, "maybe");
    ovoid_context_destroy(&context);
}

/* ---- launches and buffers ----------------------------------------------------------------- */

/* A group is no larger than the kernel's own limit, nor another than the one it was compiled for.
 */
static void test_groups(void **state) {
    (void)state;
    use_kernels("fill", fill_source);
    ovoid_context *context = open_context();
    ov_kernel fill = {0}, four = {0};
    ov_buffer buffer = {0};
    uint32_t count = 10, first = 5, out[16];
    check(context, ov_kernel_create(context, "fill", "fill", &fill));
    check(context, ov_kernel_create(context, "fill", "four", &four));
    check(context, ov_buffer_reserve(context, &buffer, sizeof out, "out"));
    assert_int_equal(fill.group, 0);
    assert_int_equal(four.group, 4);

    fill.max_group = 5; /* as for want of registers */
    check(context,
          OV_LAUNCH(context, &fill, 9, 8, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[9], 14);
    assert_int_equal(out[10], 10); /* two groups of 5, not two of 8 */

    assert_int_equal(OV_LAUNCH(context, &four, 8, 8, OV_ARG(buffer.memory)), OVOID_ERROR_ARGUMENT);
    assert_contains(ovoid_context_error(context), "kernel four is compiled for groups of 4");
    check(context, OV_LAUNCH(context, &four, 8, 4, OV_ARG(buffer.memory)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[0], 4);
    ov_kernel_destroy(&fill);
    ov_kernel_destroy(&four);
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
}

static void test_launch(void **state) {
    (void)state;
    use_kernels("fill", fill_source);
    ovoid_context *context = open_context();
    ov_kernel fill = {0}, total = {0};
    ov_buffer buffer = {0};
    uint32_t count = 10, first = 5, out[256];
    uint64_t wrong = 0;
    check(context, ov_kernel_create(context, "fill", "fill", &fill));
    check(context, ov_kernel_create(context, "fill", "total", &total));
    check(context, ov_buffer_reserve(context, &buffer, sizeof out, "out"));
    uint64_t launches = context->device->counts[OVOID_COUNT_LAUNCHES];

    check(context,
          OV_LAUNCH(context, &fill, 10, 8, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[9], 14);
    assert_int_equal(out[10], 16);
    check(context,
          OV_LAUNCH(context, &fill, 13, 0, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)));
    check(context, ov_finish(context));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[10], 13); /* the driver's groups: no rounding */
    check(context, OV_LAUNCH(context, &total, 16, 16, OV_ARG(buffer.memory),
                             OV_LOCAL(16 * sizeof(uint32_t))));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[0], 136);
    assert_int_equal(out[15], 136);
    assert_int_equal(context->device->counts[OVOID_COUNT_LAUNCHES], launches + 3);

    first = 99;
    check(context,
          OV_LAUNCH(context, &fill, 0, 8, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)));
    check(context, ov_buffer_read(context, &buffer, 0, out, sizeof out));
    assert_int_equal(out[0], 136); /* nothing happened */

    assert_int_equal(OV_LAUNCH(context, &fill, 8, 8, OV_ARG(buffer.memory), OV_ARG(count)),
                     OVOID_ERROR_ARGUMENT);
    assert_contains(ovoid_context_error(context), "fill of fill.cl takes 3 arguments, 2 were");
    assert_int_equal(
        OV_LAUNCH(context, &fill, 8, 8, OV_ARG(buffer.memory), OV_ARG(wrong), OV_ARG(first)),
        OVOID_ERROR_OPENCL);
    assert_contains(ovoid_context_error(context), "clSetKernelArg: CL_INVALID_ARG_SIZE (-51)");
    assert_contains(ovoid_context_error(context), "argument 1 of kernel fill");
    assert_int_equal(
        OV_LAUNCH(context, &fill, SIZE_MAX, 8, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)),
        OVOID_ERROR_LIMIT);
    assert_int_equal(context->device->counts[OVOID_COUNT_LAUNCHES],
                     launches + 3); /* failures do not count */
    ov_kernel_destroy(&fill);
    ov_kernel_destroy(&total);
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
}

static void test_buffer_growth(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_buffer buffer = {0};
    unsigned char bytes[1000], back[1000];
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (unsigned char)(i * 7);
    check(context, ov_buffer_reserve(context, &buffer, 0, "nothing")); /* still a real buffer */
    assert_non_null(buffer.memory);
    assert_true(buffer.bytes > 0);
    check(context, ov_buffer_reserve(context, &buffer, 1000, "bytes"));
    assert_true(buffer.bytes >= 1000);
    check(context, ov_buffer_write(context, &buffer, 0, bytes, 1000));
    check(context, ov_buffer_read(context, &buffer, 0, back, 1000));
    assert_memory_equal(bytes, back, 1000);
    cl_mem memory = buffer.memory;
    check(context, ov_buffer_reserve(context, &buffer, 10, "bytes")); /* never shrinks */
    assert_ptr_equal(buffer.memory, memory);
    check(context, ov_buffer_write(context, &buffer, 100, bytes, 10));
    check(context, ov_buffer_read(context, &buffer, 95, back, 20));
    assert_memory_equal(back, bytes + 95, 5);
    assert_memory_equal(back + 5, bytes, 10);
    assert_memory_equal(back + 15, bytes + 110, 5);

    size_t allocations = 0;
    for (size_t need = 1000; need < 1000000; need += 1000) {
        size_t before = buffer.bytes;
        check(context, ov_buffer_reserve(context, &buffer, need, "bytes"));
        assert_true(buffer.bytes >= need);
        allocations += buffer.bytes != before;
    }
    assert_in_range(allocations, 10, 25); /* log(1000) / log(1.5) = 17 */
    ov_buffer_destroy(&buffer);
    ov_buffer_destroy(&buffer);
    ov_buffer_destroy(NULL);
    assert_null(buffer.memory);
    ovoid_context_destroy(&context);
}

/* Writes end later than they return, here behind a slow kernel, and the data changes in between. */
static void test_many_writes(void **state) {
    (void)state;
    enum { WRITES = 80, WORDS = 10000, LARGE = 500000 };
    use_kernels("slow", "kernel void slow(global uint *out) {\n"
                        "    uint x = out[0];\n"
                        "    for (uint i = 0; i < 5000000; i++)\n"
                        "        x = x * 1664525 + 1013904223;\n"
                        "    out[0] = x;\n"
                        "}\n");
    ovoid_context *context = open_context();
    ov_kernel slow = {0};
    ov_buffer small = {0}, large = {0};
    uint32_t words[WORDS], *many = malloc(LARGE * sizeof(uint32_t));
    uint32_t *back = malloc(WRITES * sizeof words);
    assert_true(many && back);
    check(context, ov_kernel_create(context, "slow", "slow", &slow));
    check(context, ov_buffer_reserve(context, &small, WRITES * sizeof words, "words"));
    check(context, ov_buffer_reserve(context, &large, LARGE * sizeof(uint32_t), "many words"));
    check(context, OV_LAUNCH(context, &slow, 1, 1, OV_ARG(small.memory)));
    for (uint32_t i = 0; i < WRITES; i++) {
        for (uint32_t k = 0; k < WORDS; k++)
            words[k] = i * WORDS + k;
        check(context, ov_buffer_write(context, &small, i * sizeof words, words, sizeof words));
        if (i != WRITES / 2)
            continue;
        for (uint32_t k = 0; k < LARGE; k++)
            many[k] = 3 * k;
        check(context, ov_buffer_write(context, &large, 0, many, LARGE * sizeof(uint32_t)));
        memset(many, 0, LARGE * sizeof(uint32_t));
    }
    check(context, ov_buffer_read(context, &small, 0, back, WRITES * sizeof words));
    for (uint32_t i = 0; i < WRITES * WORDS; i++)
        assert_int_equal(back[i], i);
    check(context, ov_buffer_read(context, &large, 0, many, LARGE * sizeof(uint32_t)));
    for (uint32_t k = 0; k < LARGE; k++)
        assert_int_equal(many[k], 3 * k);
    assert_int_equal(context->device->staged_bytes, 0);
    check(context, ov_buffer_write(context, &small, 0, words, sizeof words));
    assert_int_equal(context->device->staged_bytes, sizeof words); /* did not wait */
    check(context, ov_finish(context));
    assert_int_equal(context->device->staged_bytes, 0);
    check(context, OV_LAUNCH(context, &slow, 1, 1, OV_ARG(small.memory)));
    for (int i = 0; i < 20; i++)
        check(context, ov_buffer_write(context, &small, 0, words, sizeof words));
    ov_kernel_destroy(&slow);
    ov_buffer_destroy(&small); /* and the device, while writes are under way */
    ovoid_context_destroy(&context);
    ov_buffer_destroy(&large);
    free(many);
    free(back);
}

static void test_buffer_limits(void **state) {
    (void)state;
    ovoid_context *context = open_context();
    ov_buffer buffer = {0};
    char byte = 1, text[64];
    size_t limit = (size_t)ovoid_context_device(context)->max_allocation;
    check(context, ov_buffer_reserve(context, &buffer, 100, "points"));
    cl_mem memory = buffer.memory;
    assert_int_equal(ov_buffer_reserve(context, &buffer, limit + 1, "points"), OVOID_ERROR_LIMIT);
    assert_contains(ovoid_context_error(context), "points");
    snprintf(text, sizeof text, "%zu bytes", limit + 1);
    assert_contains(ovoid_context_error(context), text);
    snprintf(text, sizeof text, "at most %zu", limit);
    assert_contains(ovoid_context_error(context), text);
    assert_ptr_equal(buffer.memory, memory); /* untouched */
    assert_int_equal(ov_buffer_reserve(context, &buffer, SIZE_MAX, "points"), OVOID_ERROR_LIMIT);

    context->device->info.max_allocation = 1200; /* growth stops at the limit */
    check(context, ov_buffer_reserve(context, &buffer, 1000, "points"));
    check(context, ov_buffer_reserve(context, &buffer, 1100, "points"));
    assert_in_range(buffer.bytes, 1100, 1200);
    context->device->info.max_allocation = limit;

    assert_int_equal(ov_buffer_write(context, &buffer, buffer.bytes, &byte, 1),
                     OVOID_ERROR_ARGUMENT);
    assert_int_equal(ov_buffer_read(context, &buffer, SIZE_MAX, &byte, 2), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ov_buffer_read(context, &buffer, 1, &byte, SIZE_MAX), OVOID_ERROR_ARGUMENT);
    check(context, ov_buffer_write(context, &buffer, 0, NULL, 0));
    check(context, ov_buffer_read(context, &buffer, SIZE_MAX, NULL, 0));
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
}

static void test_objects_outlive_device(void **state) {
    (void)state;
    use_kernels("fill", fill_source);
    ovoid_context *context = open_context();
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t count = 10, first = 5;
    check(context, ov_kernel_create(context, "fill", "fill", &kernel));
    check(context, ov_buffer_reserve(context, &buffer, 64, "bytes"));
    check(context,
          OV_LAUNCH(context, &kernel, 10, 0, OV_ARG(buffer.memory), OV_ARG(count), OV_ARG(first)));
    ovoid_context_destroy(&context); /* while the kernel may still run */
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
    assert_null(kernel.handle);
    assert_null(buffer.memory);
}

static void test_opens_itself(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    ov_device *device = NULL;
    check(context, ovoid_context_create(&context));
    check(context, ov_finish(context)); /* nothing to wait for */
    assert_null(ovoid_context_device(context));
    check(context, ov_device_get(context, &device));
    assert_ptr_equal(ovoid_context_device(context), &device->info);
    assert_true(context->close_device == ov_device_close);
    ov_device_close(context);
    assert_null(ovoid_context_device(context));
    ov_device_close(context);
    ovoid_context_destroy(&context);
}

/* ---- threads ------------------------------------------------------------------------------ */

/* cmocka's assertions belong to the main thread, so this returns what went wrong. */
static void *work(void *seed) {
    uint32_t first = *(uint32_t *)seed, count = 100, out[101];
    for (int round = 0; round < 4; round++, first += 1000) {
        ovoid_context *context = NULL;
        ov_kernel kernel = {0};
        ov_buffer buffer = {0};
        bool good = ovoid_context_create(&context) == OVOID_OK &&
                    ov_kernel_create(context, "fill", "fill", &kernel) == OVOID_OK &&
                    ov_buffer_reserve(context, &buffer, sizeof out, "out") == OVOID_OK &&
                    OV_LAUNCH(context, &kernel, count, 0, OV_ARG(buffer.memory), OV_ARG(count),
                              OV_ARG(first)) == OVOID_OK &&
                    ov_buffer_read(context, &buffer, 0, out, sizeof out) == OVOID_OK;
        for (uint32_t i = 0; good && i < count; i++)
            good = out[i] == first + i;
        ov_kernel_destroy(&kernel);
        ov_buffer_destroy(&buffer);
        ovoid_context_destroy(&context);
        if (!good)
            return "a thread failed";
    }
    return NULL;
}

static void test_threads(void **state) {
    (void)state;
    skip_on("Oclgrind", "it serves one thread");
    use_cache("threads");
    pthread_t threads[2];
    uint32_t seeds[2] = {10, 500000};
    for (int i = 0; i < 2; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, work, &seeds[i]), 0);
    for (int i = 0; i < 2; i++) {
        void *wrong = NULL;
        assert_int_equal(pthread_join(threads[i], &wrong), 0);
        assert_null(wrong);
    }
    assert_int_equal(list_files(in_scratch("threads"), NULL), 1);
}

/* ---- children ----------------------------------------------------------------------------- */

static void print_warning(const char *text, void *user) {
    (void)user;
    printf("warning: %s\n", text);
}

/* "chosen: 2, name, name" of what the selector names, or nothing. */
static void print_chosen(ovoid_context *context, const char *selector) {
    ov_device_entry *entries = NULL;
    size_t count = 0, platforms = 0, chosen[64], chosen_count = 0;
    if (ov_devices_list(context, &entries, &count, &platforms) == OVOID_OK && count < 64 &&
        ov_device_choose(context, selector, entries, count, platforms, chosen, &chosen_count) ==
            OVOID_OK) {
        printf("chosen: %zu", chosen_count);
        for (size_t n = 0; n < chosen_count; n++)
            printf(", %s", entries[chosen[n]].info.name);
        printf("\n");
    }
    free(entries);
}

/* Lists devices, opens the one asked for, and runs a kernel on it; prints what happens. */
static int list_child(void);
static int child(const char *selector) {
    if (strcmp(selector, "list") == 0)
        return list_child();
    if (!getenv("UNPREPARED"))
        ovoid_prepare_process();
    ovoid_context *context = NULL;
    ovoid_device_info *devices = NULL;
    size_t count = 0;
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t size = 0;
    if (ovoid_context_create(&context) != OVOID_OK)
        return 1;
    ovoid_context_on_warning(context, print_warning, NULL);
    ovoid_status status = ovoid_devices(context, sizeof(ovoid_device_info), &devices, &count);
    printf("devices: %s %zu\n", ovoid_status_name(status), count);
    for (size_t i = 0; i < count; i++)
        printf("device: [%s] [%s]\n", devices[i].name, devices[i].platform);
    if (getenv("PRINT_CHOSEN"))
        print_chosen(context, selector);
    status = ovoid_context_open_device(context, selector);
    printf("open: %s %s\n", ovoid_status_name(status), ovoid_context_error(context));
    if (status == OVOID_OK)
        status = ov_kernel_create(context, "layout", "layout", &kernel);
    if (status == OVOID_OK)
        status = ov_buffer_reserve(context, &buffer, 256, "layout");
    if (status == OVOID_OK)
        status = OV_LAUNCH(context, &kernel, 1, 0, OV_ARG(buffer.memory));
    if (status == OVOID_OK)
        status = ov_buffer_read(context, &buffer, 0, &size, sizeof size);
    if (status == OVOID_OK)
        printf("ran: %u\n", (unsigned)size);
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
    ovoid_free(devices);
    ovoid_context_destroy(&context);
    return 0;
}

/* Under the address sanitizer PoCL's compiler takes most of a minute where each of its allocations
 * is unwound in full. That tells leaks of drivers without frame pointers; the ones children load
 * are told without. */
static void unwind_fast(void) {
    const char *options = getenv("ASAN_OPTIONS");
    char text[512];
    snprintf(text, sizeof text, "%.400s:fast_unwind_on_malloc=1", options ? options : "");
    setenv("ASAN_OPTIONS", text, 1);
}

/* Runs a child with more environment, "NAME=value" each up to NULL ("NAME" unsets), and returns
 * what it prints on both streams; free it. */
static char *run_child(const char *selector, const char *const *environment) {
    int ends[2];
    ov_text text = {0};
    char block[1024];
    ssize_t got;
    int outcome;
    assert_int_equal(pipe(ends), 0);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        unsetenv("OVOID_DEVICE");
        unwind_fast();
        for (; *environment; environment++)
            if (strchr(*environment, '='))
                putenv((char *)*environment);
            else
                unsetenv(*environment);
        dup2(ends[1], 1);
        dup2(ends[1], 2);
        close(ends[0]);
        close(ends[1]);
        execl(self, self, "child", selector, (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    while ((got = read(ends[0], block, sizeof block)) > 0)
        check(NULL, ov_text_append(NULL, &text, block, (size_t)got));
    close(ends[0]);
    assert_int_equal(waitpid(pid, &outcome, 0), pid);
    if (!WIFEXITED(outcome) || WEXITSTATUS(outcome) != 0)
        fail_msg("the child ended with %d: %s", outcome, text.text ? text.text : "");
    return text.text;
}

static const char *setting(const char *name, const char *value) {
    static char settings[8][PATH_SIZE + 32];
    static int next;
    char *text = settings[next++ % 8];
    snprintf(text, sizeof settings[0], "%s=%s", name, value);
    return text;
}

#define CHILD(selector, ...) run_child((selector), (const char *const[]){__VA_ARGS__, NULL})

static void test_no_platform(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    mkdir(in_scratch("vendors"), 0700);
    const char *vendors = setting("OCL_ICD_VENDORS", in_scratch("vendors"));
    char *text = CHILD("", vendors, "OCL_ICD_FILENAMES");
    assert_contains(text, "devices: ok 0\n");
    assert_contains(text, "open: device no OpenCL device found");
    assert_contains(text, "pocl-opencl-icd");
    if (!strstr(text, "OpenCL driver is installed")) /* a GPU's, on this machine */
        assert_lacks(text, "warning");
    free(text);

    /* A driver whose library is not there: the loader passes over it. */
    write_text(in_scratch("vendors/broken.icd"), "libovoid-no-such-driver.so\n");
    text = CHILD("cpu", vendors, "OCL_ICD_FILENAMES");
    assert_contains(text, "devices: ok 0\n");
    assert_contains(text, "open: device no OpenCL device found");
    free(text);
}

/* A folder with the driver of fake_icd.c, and PoCL where it is installed. */
static const char *fake_vendors(bool *pocl) {
    ov_text icd = {0};
    mkdir(in_scratch("fakes"), 0700);
    write_text(in_scratch("fakes/fake.icd"), OVOID_FAKE_ICD "\n");
    *pocl = ov_text_read(NULL, &icd, "/etc/OpenCL/vendors/pocl.icd") == OVOID_OK;
    if (*pocl)
        write_text(in_scratch("fakes/pocl.icd"), icd.text);
    free(icd.text);
    return setting("OCL_ICD_VENDORS", in_scratch("fakes"));
}

static void test_failing_platform(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    char *text = CHILD("", vendors, "FAKE_ICD=fail");
    assert_contains(text, "warning: OpenCL platform Fake Platform is left out: clGetDeviceIDs: "
                          "CL_OUT_OF_RESOURCES (-5)");
    assert_contains(text, pocl ? "ran: 64\n" : "open: device no OpenCL device found");
    free(text);
    text = CHILD("", vendors, "FAKE_ICD=none"); /* no devices is no failure */
    assert_lacks(text, "warning");
    assert_contains(text, pocl ? "ran: 64\n" : "open: device no OpenCL device found");
    free(text);
}

static void test_defective_devices(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    char *text = CHILD("mute", vendors);
    assert_contains(text, "open: device device 0, Fake Mute, has no OpenCL compiler");
    assert_contains(text, "warning: a device of OpenCL platform Fake Platform is left out: "
                          "clGetDeviceInfo: CL_OUT_OF_RESOURCES (-5)");
    assert_contains(text, "device: [Fake Full 4090] [Fake Platform]\n"); /* blanks are tidied */
    free(text);
    text = CHILD("1", vendors);
    assert_contains(text, "open: device device 1, Fake Away, is not available");
    free(text);
    text = CHILD("FAKE OLD", vendors);
    assert_contains(text, "open: device device 2, Fake Old, supports \"OpenCL 1.1\"");
    free(text);
    text = CHILD("gpu", vendors); /* all there are have defects */
    assert_contains(text, "open: device device 0, Fake Mute, has no OpenCL compiler");
    free(text);
    text = CHILD("4090", vendors); /* a number that is no index is part of a name */
    assert_contains(text, "open: memory clCreateContext: CL_OUT_OF_HOST_MEMORY (-6), device Fake "
                          "Full 4090");
    free(text);
    text = CHILD("fake", vendors); /* the first without a defect */
    assert_contains(text, "open: memory clCreateContext");
    free(text);
    text = CHILD("", vendors); /* passes over the defective GPUs */
    assert_contains(text, "device Fake Full 4090");
    free(text);
    text = CHILD("", vendors, "FAKE_ICD=gpu"); /* the first GPU without one, before all others */
    assert_contains(text, "device Fake Screen");
    free(text);
    text = CHILD("nothing", vendors);
    assert_contains(text, "Fake Away, platform Fake Platform (is not available");
    free(text);
    if (pocl) {
        text = CHILD("cpu", vendors);
        assert_contains(text, "ran: 64\n");
        free(text);
    }
}

/* Without an answer to what decides on the use of a device, it is not there: of two that would do,
 * the GPU is not taken, and not counted. */
static void test_silent_devices(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    static const cl_device_info needed[] = {
        CL_DEVICE_TYPE,      CL_DEVICE_NAME,
        CL_DEVICE_VERSION,   CL_DEVICE_PREFERRED_VECTOR_WIDTH_FLOAT,
        CL_DEVICE_AVAILABLE, CL_DEVICE_COMPILER_AVAILABLE,
    };
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    for (size_t k = 0; k < sizeof needed / sizeof *needed; k++) {
        char silent[32], *text;
        snprintf(silent, sizeof silent, "FAKE_SILENT=0x%x", (unsigned)needed[k]);
        text = CHILD("fake", vendors, "FAKE_ICD=gpu", silent);
        assert_contains(text, "CL_OUT_OF_HOST_MEMORY (-6), device Fake Full 4090");
        assert_lacks(text, "Fake Screen");
        free(text);
    }
}

/* Addresses, UUIDs and lists, of devices of which two tell: "Fake Full 4090" by Khronos's
 * extensions, "Fake Screen" by NVIDIA's. */
static void test_identities(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    static const struct {
        const char *selector, *opened;
    } cases[] = {
        {"0001:3b:00.2", "Fake Full"},
        {"00000001:3B:00.2", "Fake Full"},
        {"AF:01.0", "Fake Screen"},
        {"0000:af:01.0", "Fake Screen"},
        {"01234567-89ab-cdef-0123-456789ABCDEF", "Fake Full"},
        {"GPU-01234567-89ab-cdef-0123-456789abcdef", "Fake Full"},
        {"gpu-0123", "Fake Full"},
        {"4090,fake full", "Fake Full"},
        {" gpu , af:01.0", "Fake Screen"},
        {"3b:00.2", ""}, /* of another domain */
        {"0001:3b:00", ""},
        {"gpu-012", ""},
        {"01234567-89ab-cdef", ""},
        {"gpu-01234567-89ab-cdef-0123-456789abcdef0", ""},
        {"4090,", ""},
        {",", ""},
        {"4090,nothing", ""},
    };
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char *text = CHILD(cases[k].selector, vendors, "FAKE_ICD=gpu", "LD_LIBRARY_PATH");
        char wanted[128];
        if (cases[k].opened[0])
            snprintf(wanted, sizeof wanted, "CL_OUT_OF_HOST_MEMORY (-6), device %s",
                     cases[k].opened);
        else
            snprintf(wanted, sizeof wanted, "no OpenCL device matches \"%s\"", cases[k].selector);
        assert_contains(text, wanted);
        free(text);
    }
}

/* Several devices, of one platform or two: each once, in the order in which they are named, and of
 * a kind those that can be used. */
static void test_lists(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    static const struct {
        const char *selector, *printed;
    } cases[] = {
        {"4090,af:01.0", "chosen: 2, Fake Full 4090, Fake Screen\n"},
        {"af:01.0,  4090 ", "chosen: 2, Fake Screen, Fake Full 4090\n"},
        {"4090,screen,fake full,af:01.0", "chosen: 2, Fake Full 4090, Fake Screen\n"},
        {"GPUs", "chosen: 1, Fake Screen\n"},
        {"accelerators", "chosen: 1, Fake Full 4090\n"},
        {"gpus,accelerators", "chosen: 2, Fake Screen, Fake Full 4090\n"},
        {"4090", "chosen: 1, Fake Full 4090\n"},
        {"fake mute,4090", "Fake Mute, has no OpenCL compiler"},
        {"4090,fake old", "Fake Old, supports \"OpenCL 1.1\""},
        {"4090,4711", "no OpenCL device matches \"4090,4711\""},
    };
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char *text =
            CHILD(cases[k].selector, vendors, "FAKE_ICD=gpu", "PRINT_CHOSEN=1", "LD_LIBRARY_PATH");
        assert_contains(text, cases[k].printed);
        free(text);
    }
    char *text = CHILD("All", vendors, "FAKE_ICD=gpu", "PRINT_CHOSEN=1", "LD_LIBRARY_PATH");
    assert_contains(text, pocl ? "chosen: 3, " : "chosen: 2, ");
    assert_contains(text, "Fake Full 4090, Fake Screen");
    free(text);
}

/* Two devices of PoCL: a context remembers its list. */
static int list_child(void) {
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK)
        return 1;
    ovoid_device_info *devices = NULL;
    size_t there = 0;
    ovoid_devices(context, sizeof *devices, &devices, &there);
    ovoid_free(devices);
    printf("there: %zu\nbefore: %zu\n", there, ovoid_context_device_count(context));
    if (ovoid_context_open_device(context, "1,0") != OVOID_OK)
        printf("%s\n", ovoid_context_error(context));
    const size_t count = ovoid_context_device_count(context);
    printf("after: %zu\n", count);
    for (size_t n = 0; n < count; n++)
        printf("index: %u\n", (unsigned)ovoid_context_device_at(context, n)->index);
    printf("beyond: %d\n", ovoid_context_device_at(context, count) == NULL);
    printf("own: %d\n", ovoid_context_device(context) == ovoid_context_device_at(context, 0));
    ovoid_context_open_device(context, "0");
    printf("then: %zu\n", ovoid_context_device_count(context));
    ovoid_context_destroy(&context);
    return 0;
}

static void test_remembered_list(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    char *text = CHILD("list", "POCL_DEVICES=pthread pthread");
    if (strstr(text, "there: 0\n") || strstr(text, "there: 1\n"))
        skip();
    assert_contains(text, "before: 0\nafter: 2\nindex: 1\nindex: 0\nbeyond: 1\nown: 1\nthen: 1");
    free(text);
}

/* PoCL finds no device when its cache folder cannot be written. Below a regular file not even root
 * can. */
static void test_pocl_cache(void **state) {
    (void)state;
    skip_on("Oclgrind", "it stands in for the loader");
    bool pocl;
    const char *vendors = fake_vendors(&pocl);
    if (!pocl) {
        print_message("PoCL is not installed\n");
        skip();
    }
    write_text(in_scratch("plain"), "");
    mkdir(in_scratch("temporary"), 0700);
    assert_int_equal(symlink(in_scratch("nowhere"), in_scratch("plain-link")), 0);
    const char *temporary = setting("TMPDIR", in_scratch("temporary"));
    const char *const cases[][3] = {
        {setting("POCL_CACHE_DIR", in_scratch("plain/x")), "XDG_CACHE_HOME", "HOME=/"},
        {setting("POCL_CACHE_DIR", in_scratch("plain-link")), "XDG_CACHE_HOME", "HOME=/"},
        {"POCL_CACHE_DIR", setting("XDG_CACHE_HOME", in_scratch("plain/y")), "HOME=/"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char *text = CHILD("cpu", vendors, "FAKE_ICD=none", temporary, cases[i][0], cases[i][1],
                           cases[i][2]);
        assert_contains(text, "warning: PoCL's cache folder ");
        assert_contains(text, in_scratch("plain"));
        assert_contains(text, in_scratch("temporary/ovoid-pocl-"));
        assert_contains(text, "ran: 64\n");
        free(text);
    }
    /* PoCL aborts on an empty name. */
    char *text = CHILD("cpu", vendors, "FAKE_ICD=none", "POCL_CACHE_DIR=");
    assert_contains(text, "ran: 64\n");
    assert_lacks(text, "warning");
    free(text);
}

static void test_private_folder(void **state) {
    (void)state;
    char path[PATH_SIZE], again[PATH_SIZE];
    struct stat info;
    mkdir(in_scratch("private"), 0700);
    assert_true(ov_private_folder(in_scratch("private"), path, sizeof path));
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0700);
    assert_true(ov_private_folder(in_scratch("private"), again, sizeof again)); /* as before */
    assert_string_equal(path, again);
    assert_int_equal(list_files(path, NULL), 0); /* no probe is left */

    chmod(path, 0770); /* open to others */
    assert_false(ov_private_folder(in_scratch("private"), again, sizeof again));
    chmod(path, 0700);
    if (geteuid() == 0) { /* another's */
        assert_int_equal(chown(path, 12345, (gid_t)-1), 0);
        assert_false(ov_private_folder(in_scratch("private"), again, sizeof again));
    }
    rmdir(path);
    mkdir(in_scratch("target"), 0700);
    assert_int_equal(symlink(in_scratch("target"), path), 0);
    assert_false(ov_private_folder(in_scratch("private"), again, sizeof again));
    unlink(path);
    write_text(path, "");
    assert_false(ov_private_folder(in_scratch("private"), again, sizeof again));
    assert_false(ov_private_folder("relative", again, sizeof again));
    assert_false(ov_private_folder(NULL, again, sizeof again));
    assert_false(ov_private_folder(in_scratch("private"), again, 20)); /* no room for the path */
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_error_names, clear_environment),
        cmocka_unit_test_setup(test_error_text, clear_environment),
        cmocka_unit_test_setup(test_list, clear_environment),
        cmocka_unit_test_setup(test_selectors, clear_environment),
        cmocka_unit_test_setup(test_selector_environment, clear_environment),
        cmocka_unit_test_setup(test_bad_selector, clear_environment),
        cmocka_unit_test_setup(test_shape, clear_environment),
        cmocka_unit_test_setup(test_embedded, clear_environment),
        cmocka_unit_test_setup(test_layout, clear_environment),
        cmocka_unit_test_setup(test_build_failure, clear_environment),
        cmocka_unit_test_setup(test_long_build_log, clear_environment),
        cmocka_unit_test_setup(test_missing_programs, clear_environment),
        cmocka_unit_test_setup(test_program_built_once, clear_environment),
        cmocka_unit_test_setup(test_programs_of_files, clear_environment),
        cmocka_unit_test_setup(test_cache, clear_environment),
        cmocka_unit_test_setup(test_cache_damage, clear_environment),
        cmocka_unit_test_setup(test_cache_refused, clear_environment),
        cmocka_unit_test_setup(test_cache_key, clear_environment),
        cmocka_unit_test_setup(test_cache_unwritable, clear_environment),
        cmocka_unit_test_setup(test_cache_folder, clear_environment),
        cmocka_unit_test_setup(test_cache_modes, clear_environment),
        cmocka_unit_test_setup(test_groups, clear_environment),
        cmocka_unit_test_setup(test_launch, clear_environment),
        cmocka_unit_test_setup(test_buffer_growth, clear_environment),
        cmocka_unit_test_setup(test_many_writes, clear_environment),
        cmocka_unit_test_setup(test_buffer_limits, clear_environment),
        cmocka_unit_test_setup(test_objects_outlive_device, clear_environment),
        cmocka_unit_test_setup(test_opens_itself, clear_environment),
        cmocka_unit_test_setup(test_threads, clear_environment),
        cmocka_unit_test_setup(test_no_platform, clear_environment),
        cmocka_unit_test_setup(test_failing_platform, clear_environment),
        cmocka_unit_test_setup(test_defective_devices, clear_environment),
        cmocka_unit_test_setup(test_silent_devices, clear_environment),
        cmocka_unit_test_setup(test_identities, clear_environment),
        cmocka_unit_test_setup(test_lists, clear_environment),
        cmocka_unit_test_setup(test_remembered_list, clear_environment),
        cmocka_unit_test_setup(test_pocl_cache, clear_environment),
        cmocka_unit_test_setup(test_private_folder, clear_environment),
    };
    const char *base = getenv("TMPDIR");
    if (argc == 3 && strcmp(argv[1], "child") == 0)
        return child(argv[2]);
    self = argv[0];
    snprintf(scratch, sizeof scratch, "%.300s/ovoid-device-XXXXXX", base && *base ? base : "/tmp");
    if (!mkdtemp(scratch)) {
        perror(scratch);
        return 1;
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    remove_tree(scratch);
    return failed;
}
