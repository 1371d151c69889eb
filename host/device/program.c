#include "device/internal.h"

#include "base/progress.h"

#include "shared.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The stem of the program that holds the kernels of all files. */
#define OV_WHOLE "*"

struct ov_program {
    const char *stem; /* of the file; OV_WHOLE for all of them */
    cl_program handle;
    struct ov_program *next;
};

/* A kernel that was made. */
struct ov_made {
    ov_kernel kernel;
    struct ov_made *next;
};

/* ---- sources ------------------------------------------------------------------------------ */

/* Where the kernel sources are instead of in the library, NULL for there. */
static const char *kernel_folder(void) {
    const char *folder = getenv("OVOID_KERNEL_DIR");
    return folder && *folder ? folder : NULL;
}

static ovoid_status embedded_source(ovoid_context *context, const char *name, ov_text *text) {
    for (const ov_source *source = ov_sources; source->name; source++)
        if (strcmp(source->name, name) == 0)
            return ov_text_append(context, text, source->text, strlen(source->text));
    return ov_fail(context, OVOID_ERROR_ARGUMENT, "there is no kernel source %s", name);
}

static ovoid_status file_source(ovoid_context *context, const char *folder, const char *name,
                                ov_text *text) {
    ovoid_status status = OVOID_OK;
    ov_text path = {0};
    OV_TRY(ov_text_print(context, &path, "%s/%s", folder, name));
    OV_TRY(ov_text_read(context, text, path.text));
cleanup:
    free(path.text);
    return status;
}

/* Appends one file, with a #line so that the compiler names it in its messages. */
static ovoid_status append_source(ovoid_context *context, const char *name, ov_text *text) {
    const char *folder = kernel_folder();
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_text_print(context, text, "#line 1 \"%s\"\n", name));
    if (folder)
        OV_TRY(file_source(context, folder, name, text));
    else
        OV_TRY(embedded_source(context, name, text));
    OV_TRY(ov_text_append(context, text, "\n", 1));
cleanup:
    return status;
}

static bool is_program(const char *name) {
    const char *end = strrchr(name, '.');
    return end && strcmp(end, ".cl") == 0;
}

static ovoid_status append_programs(ovoid_context *context, ov_text *text) {
    ovoid_status status = OVOID_OK;
    for (const ov_source *source = ov_sources; source->name && status == OVOID_OK; source++)
        if (is_program(source->name))
            status = append_source(context, source->name, text);
    return status;
}

static ovoid_status program_source(ovoid_context *context, const char *stem, ov_text *text) {
    ovoid_status status = OVOID_OK;
    ov_text name = {0};
    OV_TRY(ov_text_print(context, &name, "%s.cl", stem));
    OV_TRY(append_source(context, "shared.h", text));
    OV_TRY(append_source(context, "vector.clh", text));
    if (strcmp(stem, OV_WHOLE) == 0)
        OV_TRY(append_programs(context, text));
    else
        OV_TRY(append_source(context, name.text, text));
cleanup:
    free(name.text);
    return status;
}

ovoid_status ov_whole_source(ov_text *text) {
    return program_source(NULL, OV_WHOLE, text);
}

/* ---- binaries ----------------------------------------------------------------------------- */

static ovoid_status append_platform(ov_text *key, cl_platform_id id, cl_platform_info what) {
    char text[1024] = "";
    if (clGetPlatformInfo(id, what, sizeof text, text, NULL) != CL_SUCCESS)
        return OVOID_ERROR_OPENCL;
    return ov_text_append(NULL, key, text, strlen(text) + 1);
}

static ovoid_status append_device(ov_text *key, cl_device_id id, cl_device_info what) {
    char text[1024] = "";
    if (clGetDeviceInfo(id, what, sizeof text, text, NULL) != CL_SUCCESS)
        return OVOID_ERROR_OPENCL;
    return ov_text_append(NULL, key, text, strlen(text) + 1);
}

ovoid_status ov_device_key(const ov_device *device, ov_text *key) {
    ovoid_status status = OVOID_OK;
    OV_TRY(append_platform(key, device->platform, CL_PLATFORM_NAME));
    OV_TRY(append_platform(key, device->platform, CL_PLATFORM_VERSION));
    OV_TRY(append_device(key, device->id, CL_DEVICE_NAME));
    OV_TRY(append_device(key, device->id, CL_DEVICE_VENDOR));
    OV_TRY(append_device(key, device->id, CL_DEVICE_VERSION));
    OV_TRY(append_device(key, device->id, CL_DRIVER_VERSION));
cleanup:
    return status;
}

/* All that a binary depends on, each part with its null byte. Failing means no caching. */
static ovoid_status binary_key(const ov_device *device, const char *options, const ov_text *source,
                               ov_text *key) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_device_key(device, key));
    OV_TRY(ov_text_append(NULL, key, options, strlen(options) + 1));
    OV_TRY(ov_text_append(NULL, key, source->text, source->length));
cleanup:
    return status;
}

/* The program from the cache, NULL when it has none that the driver takes. */
static cl_program load_binary(const ov_device *device, const char *stem, const ov_text *key,
                              const char *options) {
    ov_text binary = {0};
    cl_program handle = NULL;
    if (ov_cache_read(stem, key, &binary)) {
        cl_int code, taken = CL_SUCCESS;
        const unsigned char *bytes = (const unsigned char *)binary.text;
        handle = clCreateProgramWithBinary(device->context, 1, &device->id, &binary.length, &bytes,
                                           &taken, &code);
        if (code != CL_SUCCESS)
            handle = NULL;
        if (handle && (taken != CL_SUCCESS ||
                       clBuildProgram(handle, 1, &device->id, options, NULL, NULL) != CL_SUCCESS)) {
            clReleaseProgram(handle);
            handle = NULL;
        }
    }
    free(binary.text);
    return handle;
}

/* A driver that hands out no binary is left alone: its programs are built anew each time. */
static void keep_binary(ovoid_context *context, ov_device *device, const char *stem,
                        const ov_text *key, cl_program handle) {
    size_t bytes = 0;
    if (clGetProgramInfo(handle, CL_PROGRAM_BINARY_SIZES, sizeof bytes, &bytes, NULL) !=
            CL_SUCCESS ||
        !bytes)
        return;
    unsigned char *binary = malloc(bytes);
    if (binary &&
        clGetProgramInfo(handle, CL_PROGRAM_BINARIES, sizeof binary, &binary, NULL) == CL_SUCCESS)
        ov_cache_write(context, device, stem, key, binary, bytes);
    free(binary);
}

/* ---- building ----------------------------------------------------------------------------- */

static void read_log(ovoid_context *context, const ov_device *device, cl_program handle,
                     ov_text *log) {
    size_t bytes = 0;
    if (clGetProgramBuildInfo(handle, device->id, CL_PROGRAM_BUILD_LOG, 0, NULL, &bytes) !=
            CL_SUCCESS ||
        !bytes)
        return;
    char *text = ov_alloc(context, bytes + 1, 1, "a build log");
    if (!text)
        return;
    if (clGetProgramBuildInfo(handle, device->id, CL_PROGRAM_BUILD_LOG, bytes, text, NULL) ==
        CL_SUCCESS) {
        size_t length = strlen(text);
        while (length && (text[length - 1] == '\n' || text[length - 1] == ' '))
            length--;
        ov_text_append(context, log, text, length);
    }
    free(text);
}

static ovoid_status fail_build(ovoid_context *context, const ov_device *device, const char *stem,
                               cl_program handle, cl_int code, const char *options) {
    ov_text log = {0};
    char disk[OV_POCL_TEXT] = "";
    read_log(context, device, handle, &log);
    if (ov_full_disk(disk, sizeof disk - 1))
        strcat(disk, "\n");
    ovoid_status status =
        ov_fail(context, ov_cl_status(code),
                "%sclBuildProgram: %s (%d), program %s.cl, device %s, driver %s\noptions: %s\n%s",
                disk, ov_cl_name(code), (int)code, stem, device->info.name, device->info.driver,
                options, log.length ? log.text : "(no build log)");
    free(log.text);
    return status;
}

static ovoid_status build_source(ovoid_context *context, const ov_device *device, const char *stem,
                                 const ov_text *source, const char *options, cl_program *built) {
    cl_int code;
    const char *text = source->text;
    size_t length = source->length;
    cl_program handle = clCreateProgramWithSource(device->context, 1, &text, &length, &code);
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clCreateProgramWithSource", stem);
    code = clBuildProgram(handle, 1, &device->id, options, NULL, NULL);
    if (code != CL_SUCCESS) {
        ovoid_status status = fail_build(context, device, stem, handle, code, options);
        clReleaseProgram(handle);
        return status;
    }
    *built = handle;
    return OVOID_OK;
}

void ov_program_options(const ov_device *device, char options[OV_OPTIONS_SIZE]) {
    snprintf(options, OV_OPTIONS_SIZE,
             "-cl-std=CL1.2 -DOV_VECTOR=%u -DOV_LANES=%u -DOV_PACK=%d -DOV_TEAM=%u "
             "-DOV_SOLVE_GROUP=%u",
             (unsigned)device->shape.vector, (unsigned)device->shape.lanes, OV_PACK,
             (unsigned)device->team, (unsigned)device->solve_group);
}

static ovoid_status make_program(ovoid_context *context, ov_device *device, const char *stem,
                                 cl_program *handle) {
    ovoid_status status = OVOID_OK;
    ov_text source = {0}, key = {0};
    cl_program made = NULL;
    char options[OV_OPTIONS_SIZE];
    ov_program_options(device, options);
    OV_TRY(program_source(context, stem, &source));
    bool cache =
        ov_cache_wanted(context, device) && binary_key(device, options, &source, &key) == OVOID_OK;
    if (cache)
        made = load_binary(device, stem, &key, options);
    if (made) {
        device->loaded++;
    } else {
        OV_TRY(build_source(context, device, stem, &source, options, &made));
        device->built++;
        if (cache)
            keep_binary(context, device, stem, &key, made);
    }
    *handle = made;
cleanup:
    free(source.text);
    free(key.text);
    return status;
}

/* PoCL reads its own headers anew for each program, even for one that it has kept compiled: some 40
 * ms, where a small molecule's fit takes less than a second and nine programs. All kernels in one
 * program take 50. They cost nothing more, since PoCL compiles a kernel only when it is first
 * launched; other drivers compile what they are given. */
static bool builds_whole(ovoid_context *context, ov_device *device) {
    return strcmp(device->info.platform, OV_POCL_PLATFORM) == 0 && !kernel_folder() &&
           !ov_cache_wanted(context, device);
}

static bool is_embedded(const char *stem) {
    const size_t length = strlen(stem);
    for (const ov_source *source = ov_sources; source->name; source++)
        if (strncmp(source->name, stem, length) == 0 && strcmp(source->name + length, ".cl") == 0)
            return true;
    return false;
}

static ovoid_status get_program(ovoid_context *context, ov_device *device, const char *stem,
                                cl_program *handle) {
    if (is_embedded(stem) && builds_whole(context, device))
        stem = OV_WHOLE;
    for (struct ov_program *p = device->programs; p; p = p->next) {
        if (strcmp(p->stem, stem) == 0) {
            *handle = p->handle;
            return OVOID_OK;
        }
    }
    struct ov_program *program = ov_alloc(context, 1, sizeof *program, "a program");
    if (!program)
        return OVOID_ERROR_MEMORY;
    const char *const before = ov_progress_stage(context, "compile");
    ovoid_status status = ov_progress_ask(context);
    if (status == OVOID_OK)
        status = make_program(context, device, stem, &program->handle);
    ov_progress_stage(context, before);
    if (status != OVOID_OK) {
        free(program);
        return status;
    }
    program->stem = stem;
    program->next = device->programs;
    device->programs = program;
    *handle = program->handle;
    return OVOID_OK;
}

void ov_programs_release(ov_device *device) {
    while (device->made) {
        struct ov_made *made = device->made;
        device->made = made->next;
        ov_release_kernel(made->kernel.handle);
        free(made);
    }
    while (device->programs) {
        struct ov_program *program = device->programs;
        device->programs = program->next;
        ov_release_program(program->handle);
        free(program);
    }
}

/* ---- kernels ------------------------------------------------------------------------------ */

static ovoid_status fail_create(ovoid_context *context, const ov_kernel *kernel, cl_int code) {
    return ov_fail(context, ov_cl_status(code),
                   "clCreateKernel: %s (%d), kernel %s of %s.cl, device %s", ov_cl_name(code),
                   (int)code, kernel->name, kernel->program, context->device->info.name);
}

/* Fills in all but the names. */
static ovoid_status make_kernel(ovoid_context *context, ov_device *device, ov_kernel *kernel) {
    cl_program handle;
    cl_int code;
    cl_uint arg_count = 0;
    ovoid_status status = get_program(context, device, kernel->program, &handle);
    if (status != OVOID_OK)
        return status;
    kernel->handle = clCreateKernel(handle, kernel->name, &code);
    if (code != CL_SUCCESS)
        return fail_create(context, kernel, code);
    device->counts[OVOID_COUNT_KERNELS_CREATED]++;
    const char *call = "clGetKernelInfo";
    code = clGetKernelInfo(kernel->handle, CL_KERNEL_NUM_ARGS, sizeof arg_count, &arg_count, NULL);
    if (code == CL_SUCCESS) {
        call = "clGetKernelWorkGroupInfo";
        code = clGetKernelWorkGroupInfo(kernel->handle, device->id, CL_KERNEL_WORK_GROUP_SIZE,
                                        sizeof kernel->max_group, &kernel->max_group, NULL);
    }
    size_t group[3] = {0};
    if (code == CL_SUCCESS)
        code =
            clGetKernelWorkGroupInfo(kernel->handle, device->id, CL_KERNEL_COMPILE_WORK_GROUP_SIZE,
                                     sizeof group, group, NULL);
    kernel->arg_count = arg_count;
    kernel->group = group[0];
    if (code == CL_SUCCESS)
        return OVOID_OK;
    clReleaseKernel(kernel->handle);
    return ov_cl_fail(context, code, call, kernel->name);
}

/* Makes a kernel that the device has not got yet. */
static ovoid_status add_kernel(ovoid_context *context, ov_device *device, const char *program,
                               const char *name, struct ov_made **added) {
    struct ov_made *made = ov_alloc(context, 1, sizeof *made, "a kernel");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->kernel = (ov_kernel){.program = program, .name = name};
    const ovoid_status status = make_kernel(context, device, &made->kernel);
    if (status != OVOID_OK) {
        free(made);
        return status;
    }
    made->next = device->made;
    device->made = made;
    *added = made;
    return OVOID_OK;
}

ovoid_status ov_kernel_create(ovoid_context *context, const char *program, const char *name,
                              ov_kernel *kernel) {
    ov_device *device;
    ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    if ((status = ov_device_trust(context, device)) != OVOID_OK)
        return status;
    struct ov_made *made = device->made;
    while (made &&
           (strcmp(made->kernel.name, name) != 0 || strcmp(made->kernel.program, program) != 0))
        made = made->next;
    if (!made && (status = add_kernel(context, device, program, name, &made)) != OVOID_OK)
        return status;
    const cl_int code = clRetainKernel(made->kernel.handle); /* it may outlive the device */
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clRetainKernel", name);
    *kernel = made->kernel;
    return OVOID_OK;
}

void ov_kernel_destroy(ov_kernel *kernel) {
    if (!kernel)
        return;
    if (kernel->handle)
        ov_release_kernel(kernel->handle);
    *kernel = (ov_kernel){0};
}
