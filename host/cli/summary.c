#include "fit.h"
#include "ranks.h"

#include <math.h>
#include <string.h>

typedef unsigned long long count; /* as printf wants it */

static const char *plural(count number) {
    return number == 1 ? "" : "s";
}

void fit_summary_before(const fit_job *job) {
    if (!job->summary)
        return;
    reading_print(&job->reading, job->summary, job->input, job->molecule);
    cli_print_devices(job->context, job->summary);
    fflush(job->summary);
}

static void print_written(FILE *out, const char *what, const char *path) {
    fprintf(out, "%-8s  written to %s\n", what, strcmp(path, "-") == 0 ? "standard output" : path);
}

static void print_work(FILE *out, const fit_job *job) {
    const ovoid_fit_result *result = &job->levels[0].result;
    const ovoid_fit_options *options = &job->options;
    const char *method = fit_method_name(options->method);
    if (options->method == OVOID_METHOD_L1)
        fprintf(out, "fit       %llu iteration%s of method %s%s\n", (count)result->iterations,
                plural(result->iterations), method,
                options->l1.kernel == OVOID_KERNEL_SPHERE ? ", spheres at the atoms" : "");
    else
        fprintf(out, "fit       %llu step%s of refinement, %llu of conjugate gradients, method %s",
                (count)result->iterations, plural(result->iterations),
                (count)result->adaptive.solver_iterations, method);
    if (options->method == OVOID_METHOD_ADAPTIVE && result->parts > 1)
        fprintf(out, ", %llu parts", (count)result->parts);
    if (options->method == OVOID_METHOD_ADAPTIVE && result->units > 1)
        fprintf(out, ", one of %llu units", (count)result->units);
    if (job->shared)
        fprintf(out, ", %u ranks", (unsigned)ranks_count());
    if (options->method == OVOID_METHOD_ADAPTIVE)
        putc('\n', out);
}

static void print_stop(FILE *out, const fit_job *job) {
    if (!job->out_of_time)
        return;
    fprintf(out, "stopped   after the %.9g s of --time-limit: ", job->time_limit);
    if (job->levels[job->levels_done - 1].stopped && job->levels_done == 1)
        fputs("the best model that held by then\n", out);
    else
        fprintf(out, "%zu of %u levels\n", job->levels_done, (unsigned)job->level_count);
}

/* What method adaptive was to reach, and what it reached. */
static void print_goal(FILE *out, const fit_job *job) {
    const ovoid_fit_result *result = &job->levels[0].result;
    const ovoid_adaptive_options *wanted = &job->options.adaptive;
    const char *reached = result->reached ? "reached" : "not reached";
    const bool tolerance = wanted->goal == OVOID_GOAL_TOLERANCE;
    char text[FIT_DISTANCE_TEXT], reason[FIT_REASON_TEXT];
    fputs("goal      ", out);
    if (tolerance)
        fprintf(out, "outer surfaces within %.9g Å: ", wanted->tolerance);
    else if (wanted->goal == OVOID_GOAL_ELLIPSOIDS)
        fprintf(out, "%u ellipsoid%s: ", (unsigned)wanted->ellipsoids, plural(wanted->ellipsoids));
    else
        fprintf(out, "%.9g ellipsoids per atom: ", wanted->ratio);
    if (tolerance && result->verdict != OVOID_VERDICT_REACHED &&
        result->verdict != OVOID_VERDICT_MISSED)
        fprintf(out, "%s: %s\n", reached, fit_unreached(job, reason));
    else if (isfinite(result->distance))
        fprintf(out, "%s, %s%s Å\n", reached, tolerance ? "" : "outer surfaces within ",
                fit_distance(result->distance, wanted->tolerance, text));
    else
        fprintf(out, "%s\n", reached);
}

static void print_measure(FILE *out, bool known, int width, double value) {
    if (known)
        fprintf(out, " %*.3g", width, value);
    else
        fprintf(out, " %*s", width, "-");
}

/* A row per level; distances are those of the outer surfaces. */
static void print_levels(FILE *out, const fit_job *job) {
    fputs("level  ellipsoids   area error %  volume error %  Hausdorff Å  mean Å  file\n", out);
    for (size_t i = 0; i < job->levels_done; i++) {
        const fit_level *level = &job->levels[i];
        const ovoid_measures *measures = &level->measures;
        const double hausdorff =
            level->measured ? measures->distances_outer.hausdorff : level->result.distance;
        fprintf(out, "%-5zu  %10llu", i + 1, (count)level->result.ellipsoids);
        print_measure(out, level->measured, 14, 100.0 * measures->area.error);
        print_measure(out, level->measured, 15, 100.0 * measures->volume.error);
        print_measure(out, isfinite(hausdorff), 12, hausdorff);
        print_measure(out, level->measured, 7, measures->distances_outer.mean);
        fprintf(out, "  %s\n", level->path);
    }
    const size_t last = job->levels_done - 1;
    if (job->levels_done < job->level_count && job->levels[last].result.ellipsoids == 1)
        fprintf(out, "%zu of %u levels: one ellipsoid cannot be halved\n", job->levels_done,
                (unsigned)job->level_count);
}

void fit_summary_after(const fit_job *job) {
    const fit_level *first = &job->levels[0];
    const ovoid_fit_result *result = &first->result;
    const ovoid_fit_options *options = &job->options;
    const bool l1 = options->method == OVOID_METHOD_L1;
    FILE *out = job->summary;
    cli_progress_erase();
    if (!out)
        return;
    fprintf(out, "surface   decay %.9g Å⁻², isovalue %.9g\n", options->decay, options->isovalue);
    fprintf(out, "points    %llu, spacing %.9g Å", (count)result->points, result->spacing);
    if (l1) /* adaptive may take more than was asked for */
        fprintf(out, ", padding %.9g Å", options->padding);
    putc('\n', out);
    const count atoms = ovoid_molecule_atoms(job->molecule);
    print_work(out, job);
    fit_work_print(&job->work, out);
    print_stop(out, job);
    if (!l1)
        print_goal(out, job);
    fprintf(out, "model     %llu ellipsoid%s for %llu atom%s: sparse ratio %.3g",
            (count)result->ellipsoids, plural(result->ellipsoids), atoms, plural(atoms),
            (double)result->ellipsoids / (double)atoms);
    source_print_placements(first->model, out);
    putc('\n', out);
    if (l1)
        fprintf(out, "error     rms %.3g, largest %.3g (of the field, over the points)\n",
                result->l1.rms_error, result->l1.max_error);
    if (first->measured)
        measures_print(out, &first->measures, &job->measuring);
    if (job->level_count > 1)
        print_levels(out, job);
    fprintf(out,
            "time      %.2f s: device %.2f, read %.2f, sample %.2f, fit %.2f, measure %.2f, write "
            "%.2f\n",
            job->total_seconds, job->device_seconds, job->read_seconds, fit_sample_seconds(job),
            fit_fit_seconds(job), job->measure_seconds, job->write_seconds);
    print_written(out, "model", first->path);
    if (job->report && !job->report_failed)
        print_written(out, "report", job->report);
    if (job->trace && !job->tracer.failed)
        print_written(out, "trace", job->trace);
    if (job->owners && !job->owners_failed)
        print_written(out, "owners", job->owners);
    if (job->profile.known)
        fit_work_print_table(&job->work, out);
    cli_profile_print(&job->profile, "fit", out);
}
