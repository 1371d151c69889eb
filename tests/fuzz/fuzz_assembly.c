/*
 * Assemblies: the first line names the one that is asked for, as --assembly has it, and each
 * further line is a row of the category that describes them: assembly, expression, chains, with
 * tabs between them. Atoms and operators are always the same.
 */
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char head[] =
    "data_x\nloop_\n_atom_site.id\n_atom_site.type_symbol\n_atom_site.label_atom_id\n"
    "_atom_site.label_comp_id\n_atom_site.label_asym_id\n_atom_site.label_seq_id\n"
    "_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n"
    "1 C CA GLY A 1 0 0 0\n2 C CA GLY A 2 3 0 0\n3 C CA GLY B 1 0 3 0\n4 O O HOH C 1 0 0 3\n"
    "loop_\n_pdbx_struct_oper_list.id\n"
    "_pdbx_struct_oper_list.matrix[1][1]\n_pdbx_struct_oper_list.matrix[1][2]\n"
    "_pdbx_struct_oper_list.matrix[1][3]\n_pdbx_struct_oper_list.vector[1]\n"
    "_pdbx_struct_oper_list.matrix[2][1]\n_pdbx_struct_oper_list.matrix[2][2]\n"
    "_pdbx_struct_oper_list.matrix[2][3]\n_pdbx_struct_oper_list.vector[2]\n"
    "_pdbx_struct_oper_list.matrix[3][1]\n_pdbx_struct_oper_list.matrix[3][2]\n"
    "_pdbx_struct_oper_list.matrix[3][3]\n_pdbx_struct_oper_list.vector[3]\n"
    "1 1 0 0 0 0 1 0 0 0 0 1 0\n2 -1 0 0 5 0 -1 0 0 0 0 1 0\n3 0 1 0 0 -1 0 0 9 0 0 1 0\n"
    "P 1 0 0 1e5 0 1 0 0 0 0 1 0\nX0 0 1 0 0 0 0 1 0 1 0 0 0\n"
    "M -1 0 0 0 0 1 0 0 0 0 1 0\n"
    "loop_\n_pdbx_struct_assembly_gen.assembly_id\n"
    "_pdbx_struct_assembly_gen.oper_expression\n_pdbx_struct_assembly_gen.asym_id_list\n";

/* A value as a text field; one cannot hold a line that begins with ';', nor a zero. */
static void write_value(FILE *file, const char *text, size_t length) {
    fputs("\n;", file);
    for (size_t i = 0; i < length; i++)
        putc(text[i] && text[i] != ';' ? text[i] : '_', file);
    fputs("\n;", file);
}

static void write_row(FILE *file, const char *line, size_t length) {
    const char *end = line + length;
    for (int i = 0; i < 3; i++) {
        const char *tab = line < end ? memchr(line, '\t', (size_t)(end - line)) : NULL;
        const char *stop = tab && i < 2 ? tab : end;
        write_value(file, line, (size_t)(stop - line));
        line = stop < end ? stop + 1 : end;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const char *at = (const char *)data, *end = at + size;
    char *text = NULL, name[64] = "";
    size_t length = 0;
    FILE *file = open_memstream(&text, &length);
    if (!file)
        abort();
    fputs(head, file);
    for (int row = 0; at < end || row < 2; row++) {
        const char *stop = at < end ? memchr(at, '\n', (size_t)(end - at)) : NULL;
        const size_t bytes = (size_t)((stop ? stop : end) - at);
        if (row == 0)
            snprintf(name, sizeof name, "%.*s", bytes < sizeof name ? (int)bytes : 63, at);
        else
            write_row(file, at, bytes);
        at = stop ? stop + 1 : end;
    }
    fputc('\n', file);
    fclose(file);
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.format = OVOID_MOLECULE_MMCIF;
    options.assembly = name;
    ovoid_molecule *m = fuzz_read(fuzz_file(0, text, length), &options);
    ovoid_molecule_destroy(&m);
    free(text);
    return 0;
}
