#include "fit.h"

#include <string.h>

typedef unsigned long long count; /* as printf wants it */

static const char *plural(count number) {
    return number == 1 ? "" : "s";
}

static void print_molecule(const fit_job *job) {
    ovoid_molecule_counts counts = ovoid_molecule_read_counts(job->molecule);
    FILE *out = job->summary;
    fprintf(out, "molecule  %s: %llu atom%s",
            strcmp(job->input, "-") == 0 ? "standard input" : job->input, (count)counts.atoms,
            plural(counts.atoms));
    if (counts.zero_radius)
        fprintf(out, ", %llu of them of radius 0", (count)counts.zero_radius);
    if (counts.skipped)
        fprintf(out, ", %llu skipped", (count)counts.skipped);
    const char *between = " (";
    if (counts.skipped_models) {
        fprintf(out, "%s%llu in MODEL 2 and later", between, (count)counts.skipped_models);
        between = ", ";
    }
    if (counts.skipped_altlocs) {
        fprintf(out, "%s%llu at alternate locations", between, (count)counts.skipped_altlocs);
        between = ", ";
    }
    fprintf(out, "%s\n", between[0] == ',' ? ")" : "");
}

void fit_summary_before(const fit_job *job) {
    const ovoid_device_info *device = ovoid_context_device(job->context);
    if (!job->summary)
        return;
    print_molecule(job);
    fprintf(job->summary, "device    %s (%s, driver %s)\n", device->name, device->platform,
            device->driver);
    fflush(job->summary);
}

static void print_written(FILE *out, const char *what, const char *path) {
    fprintf(out, "%-8s  written to %s\n", what, strcmp(path, "-") == 0 ? "standard output" : path);
}

void fit_summary_after(const fit_job *job) {
    const ovoid_fit_result *result = &job->result;
    const ovoid_fit_options *options = &job->options;
    FILE *out = job->summary;
    if (!out)
        return;
    fprintf(out, "surface   decay %.9g Å⁻², isovalue %.9g\n", options->decay, options->isovalue);
    fprintf(out, "points    %llu, spacing %.9g Å, padding %.9g Å\n", (count)result->points,
            options->spacing, options->padding);
    const count atoms = ovoid_molecule_atoms(job->molecule);
    fprintf(out, "fit       %llu iteration%s of method %s%s\n", (count)result->iterations,
            plural(result->iterations), fit_method_name(options->method),
            options->l1.kernel == OVOID_KERNEL_SPHERE ? ", spheres at the atoms" : "");
    fprintf(out, "model     %llu ellipsoid%s for %llu atom%s: sparse ratio %.3g\n",
            (count)result->ellipsoids, plural(result->ellipsoids), atoms, plural(atoms),
            (double)result->ellipsoids / (double)atoms);
    fprintf(out, "error     rms %.3g, largest %.3g (of the field, over the points)\n",
            result->rms_error, result->max_error);
    if (job->measured)
        measures_print(out, &job->measures, &job->measuring);
    fprintf(out,
            "time      %.2f s: device %.2f, read %.2f, sample %.2f, fit %.2f, measure %.2f, write "
            "%.2f\n",
            job->total_seconds, job->device_seconds, job->read_seconds, result->sample_seconds,
            result->fit_seconds, job->measure_seconds, job->write_seconds);
    print_written(out, "model", job->output);
    if (job->report && !job->report_failed)
        print_written(out, "report", job->report);
    if (job->trace && !job->tracer.failed)
        print_written(out, "trace", job->trace);
}
