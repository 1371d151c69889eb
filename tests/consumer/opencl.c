/* A program's own OpenCL context and queue: a field evaluated into its buffer, which a kernel of
 * its own reads. */
#define CL_TARGET_OPENCL_VERSION 120
#include <math.h>
#include <ovoid/opencl.h>
#include <ovoid/ovoid.h>
#include <stdio.h>

enum { POINTS = 1000 };

static const char source[] = "__kernel void halve(__global float *value) {\n"
                             "    value[get_global_id(0)] *= 0.5f;\n"
                             "}\n";

typedef struct opencl {
    cl_device_id device;
    cl_context context;
    cl_command_queue queue;
    cl_kernel halve;
    cl_mem value;
} opencl;

static bool begin(opencl *cl) {
    cl_platform_id platform;
    cl_int code[4];
    if (clGetPlatformIDs(1, &platform, NULL) != CL_SUCCESS ||
        clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &cl->device, NULL) != CL_SUCCESS)
        return false;
    const char *text = source;
    cl->context = clCreateContext(NULL, 1, &cl->device, NULL, NULL, &code[0]);
    cl->queue = clCreateCommandQueue(cl->context, cl->device, 0, &code[1]);
    cl_program program = clCreateProgramWithSource(cl->context, 1, &text, NULL, &code[2]);
    const bool built = clBuildProgram(program, 1, &cl->device, "", NULL, NULL) == CL_SUCCESS;
    cl->halve = built ? clCreateKernel(program, "halve", NULL) : NULL;
    clReleaseProgram(program);
    cl->value =
        clCreateBuffer(cl->context, CL_MEM_READ_WRITE, POINTS * sizeof(float), NULL, &code[3]);
    return code[0] == CL_SUCCESS && code[1] == CL_SUCCESS && code[3] == CL_SUCCESS && cl->halve;
}

static void end(opencl *cl) {
    clReleaseMemObject(cl->value);
    clReleaseKernel(cl->halve);
    clReleaseCommandQueue(cl->queue);
    clReleaseContext(cl->context);
}

/* Halves what Ovoid has put into the buffer, and brings it to the host. */
static bool halve(opencl *cl, float *value) {
    const size_t count = POINTS;
    return clSetKernelArg(cl->halve, 0, sizeof cl->value, &cl->value) == CL_SUCCESS &&
           clEnqueueNDRangeKernel(cl->queue, cl->halve, 1, NULL, &count, NULL, 0, NULL, NULL) ==
               CL_SUCCESS &&
           clEnqueueReadBuffer(cl->queue, cl->value, CL_TRUE, 0, count * sizeof *value, value, 0,
                               NULL, NULL) == CL_SUCCESS;
}

static bool compare(const double *wanted, const float *halves) {
    for (size_t k = 0; k < POINTS; ++k)
        if (!(fabs(2.0 * (double)halves[k] - wanted[k]) <= 1e-6 * wanted[k])) {
            fprintf(stderr, "point %zu: %g, not half of %g\n", k, (double)halves[k], wanted[k]);
            return false;
        }
    return true;
}

int main(int argc, char **argv) {
    static double xyz[3 * POINTS], value[POINTS];
    static float halves[POINTS];
    opencl cl;
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    ovoid_prepare_process();
    if (!begin(&cl)) {
        fputs("there is no OpenCL device\n", stderr);
        return 1;
    }
    for (size_t k = 0; k < POINTS; ++k)
        xyz[3 * k] = 0.003 * (double)k;
    const bool done =
        argc == 2 && ovoid_context_create(&context) == OVOID_OK &&
        ovoid_context_open_opencl(context, cl.context, cl.device, cl.queue) == OVOID_OK &&
        ovoid_molecule_read(context, argv[1], OVOID_MOLECULE_AUTO, &molecule) == OVOID_OK &&
        ovoid_field_of_molecule(context, molecule, OVOID_DEFAULT_DECAY, OVOID_DEFAULT_ISOVALUE,
                                &field) == OVOID_OK &&
        ovoid_field_evaluate_opencl(context, field, xyz, POINTS, cl.value, NULL) == OVOID_OK &&
        halve(&cl, halves) &&
        ovoid_field_evaluate(context, field, xyz, POINTS, value, NULL) == OVOID_OK;
    if (done)
        printf("%d values on %s\n", POINTS, ovoid_context_device(context)->name);
    else
        fprintf(stderr, "%s\n", context ? ovoid_context_error(context) : "opencl MOLECULE");
    ovoid_field_destroy(&field);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    end(&cl);
    return done && compare(value, halves) ? 0 : 1;
}
