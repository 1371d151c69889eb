#include "fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Several molecules, one after the other, on a device that is opened once. */
typedef struct batch {
    fit_job *asked; /* what each molecule's job begins as */
    fit_row *rows;
    size_t done;
    FILE *lines; /* of the report, as they come; NULL: none */
    char *text;  /* what was written to it, `size` bytes, once it is closed */
    size_t size;
    bool lost; /* a line could not be made */
} batch;

/* ---- the report ----------------------------------------------------------------------------- */

/* All that is known of a molecule whose model was written, and else why there is none. */
static cJSON *make_line(const fit_job *one, int code) {
    cJSON *line = one->written ? fit_report_make(one) : cJSON_CreateObject();
    bool good = line != NULL;
    if (good && !one->written)
        good = cli_json_string(line, "version", ovoid_version()) &&
               cli_json_string(line, "input", one->input) &&
               (!one->number || cJSON_AddNumberToObject(line, "model", one->number));
    good = good && cli_json_string(line, "status", fit_status_name(code)) &&
           cJSON_AddNumberToObject(line, "exit_code", code);
    if (good && !fit_made_model(code))
        good = cli_json_string(line, "error", cli_last_error());
    if (!good) {
        cJSON_Delete(line);
        line = NULL;
    }
    return line;
}

static void add_line(batch *b, const fit_job *one, int code) {
    if (!b->lines)
        return;
    cJSON *line = make_line(one, code);
    char *text = line ? cJSON_PrintUnformatted(line) : NULL;
    if (!text || fprintf(b->lines, "%s\n", text) < 0)
        b->lost = true;
    cJSON_free(text);
    cJSON_Delete(line);
}

static int write_lines(batch *b) {
    ovoid_context *const context = b->asked->context;
    ovoid_file *file = NULL;
    const bool closed = fclose(b->lines) == 0;
    b->lines = NULL;
    if (!closed || b->lost) {
        cli_error("out of memory for the report");
        return CLI_COMPUTE;
    }
    ovoid_status status = ovoid_file_create(context, b->asked->report, &file);
    if (status == OVOID_OK)
        status = ovoid_file_write(context, file, b->text, b->size);
    if (status == OVOID_OK)
        status = ovoid_file_commit(context, file);
    ovoid_file_destroy(&file);
    return status == OVOID_OK ? CLI_OK : cli_failure(context, status, CLI_OUTPUT);
}

/* ---- one of them ---------------------------------------------------------------------------- */

static fit_row make_row(const fit_job *one, int code) {
    const fit_level *const level = &one->levels[0];
    return (fit_row){.input = one->input,
                     .model = one->number,
                     .code = code,
                     .measured = one->written && level->measured,
                     .atoms = one->molecule ? ovoid_molecule_atoms(one->molecule) : 0,
                     .ellipsoids = one->written ? level->result.ellipsoids : 0,
                     .distance = one->written ? level->result.distance : NAN,
                     .area = level->measures.area.original,
                     .volume = level->measures.volume.original,
                     .seconds = cli_seconds() - one->started};
}

/* "3/10 model 7", or "3/10 name" with as much of the name as leaves room for other parts of a
 * progress line. */
static void make_label(const fit_job *asked, size_t index, char *label, size_t size) {
    enum { ROOM = 20 };
    if (asked->numbers) {
        snprintf(label, size, "%zu/%zu model %d", index + 1, asked->input_count,
                 (int)asked->numbers[index]);
        return;
    }
    const char *const input = asked->inputs[index], *const slash = strrchr(input, '/');
    const char *const name = slash ? slash + 1 : input;
    size_t length = strlen(name);
    if (length > ROOM)
        for (length = ROOM; length > 0 && ((unsigned char)name[length] & 0xc0) == 0x80; length--) {
        } /* no part of a character */
    snprintf(label, size, "%zu/%zu %.*s", index + 1, asked->input_count, (int)length, name);
}

/* What messages are about: the file, or the model of it. */
static char *make_subject(const fit_job *one) {
    const size_t size = strlen(one->input) + 32;
    char *const text = malloc(size);
    if (text && one->number)
        snprintf(text, size, "%s, model %d", one->input, (int)one->number);
    else if (text)
        strcpy(text, one->input);
    return text;
}

static void run_one(batch *b, size_t index) {
    char label[96];
    fit_job one = *b->asked;
    one.input = one.inputs[index];
    one.number = one.numbers ? one.numbers[index] : 0;
    if (one.number)
        one.reading.options.model = one.number;
    char *const subject = make_subject(&one);
    one.report = NULL;
    one.summary = NULL;
    one.profile = (cli_profile){0};
    one.started = cli_seconds();
    one.label = label;
    make_label(&one, index, label, sizeof label);
    cli_message_subject(subject ? subject : one.input);
    const int code = fit_outputs_name(&one) ? fit_run(&one) : CLI_COMPUTE;
    if (code < 128) { /* not stopped by a signal */
        b->rows[b->done++] = make_row(&one, code);
        add_line(b, &one, code);
    }
    cli_message_subject(NULL);
    cli_progress_erase();
    cli_progress_start(one.quiet, NULL); /* the label ends here */
    if (one.session)
        fit_session_keep(&one);
    fit_job_destroy(&one);
    free(subject);
}

/* ---- all of them ---------------------------------------------------------------------------- */

static int make_folder(const char *folder) {
    struct stat info;
    if (mkdir(folder, 0777) == 0 || (stat(folder, &info) == 0 && S_ISDIR(info.st_mode)))
        return CLI_OK;
    cli_error("cannot make the folder '%s': %s", folder, strerror(errno));
    return CLI_OUTPUT;
}

static int prepare(batch *b) {
    fit_job *const asked = b->asked;
    ovoid_status status;
    const int code = asked->folder ? make_folder(asked->folder) : CLI_OK;
    if (code != CLI_OK)
        return code;
    if (asked->report && (status = ovoid_file_check(asked->context, asked->report)) != OVOID_OK)
        return cli_failure(asked->context, status, CLI_OUTPUT);
    if ((status = ovoid_context_open_device(asked->context, asked->device)) != OVOID_OK)
        return cli_failure(asked->context, status, CLI_DEVICE);
    b->rows = calloc(asked->input_count, sizeof *b->rows);
    b->lines = asked->report ? open_memstream(&b->text, &b->size) : NULL;
    if (!b->rows || (asked->report && !b->lines)) {
        cli_error("out of memory");
        return CLI_COMPUTE;
    }
    if ((status = cli_profile_begin(&asked->profile, asked->context)) != OVOID_OK)
        return cli_failure(asked->context, status, CLI_OUTPUT);
    return CLI_OK;
}

/* As if one: all did well, or none did and all for the same reason; else what only several can. */
static int code_of(const fit_row *rows, size_t count) {
    size_t failed = 0;
    int goal = CLI_OK, first = CLI_OK, code = CLI_OK;
    for (size_t i = 0; i < count; i++) {
        if (rows[i].code == CLI_GOAL)
            goal = CLI_GOAL;
        if (fit_made_model(rows[i].code))
            continue;
        code = failed++ == 0 ? first = rows[i].code : rows[i].code == first ? code : CLI_NONE;
    }
    return failed == 0 ? goal : failed < count ? CLI_SOME : code;
}

/* Tells what came of those that were done, a signal or not. */
static int finish(batch *b) {
    fit_job *const asked = b->asked;
    const int code = code_of(b->rows, b->done);
    int own = CLI_OK; /* what comes of the batch itself */
    const ovoid_status status = cli_profile_end(&asked->profile, asked->context);
    if (asked->report)
        own = write_lines(b);
    if (asked->summary) {
        fit_batch_print(asked->summary, asked, b->rows, b->done);
        if (asked->report && own == CLI_OK)
            fprintf(asked->summary, "report written to %s\n",
                    strcmp(asked->report, "-") == 0 ? "standard output" : asked->report);
        cli_profile_print(&asked->profile, "all fits", asked->summary);
    }
    if (status != OVOID_OK)
        own = cli_failure(asked->context, status, CLI_OUTPUT);
    if (cli_interrupted())
        return 128 + cli_interrupted();
    return own != CLI_OK && fit_made_model(code) ? own : code;
}

int fit_batch(fit_job *job) {
    batch b = {.asked = job};
    int code = prepare(&b);
    if (code == CLI_OK) {
        for (size_t i = 0; i < job->input_count && !cli_interrupted(); i++)
            run_one(&b, i);
        if (cli_interrupted())
            cli_tell_interrupted();
        cli_finish_in_any_case(true);
        code = finish(&b);
    }
    if (b.lines)
        fclose(b.lines);
    free(b.text);
    free(b.rows);
    return code;
}
