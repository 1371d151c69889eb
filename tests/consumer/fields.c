/* A field made once: evaluated, meshed, and measured against a model's. */
#include <ovoid/ovoid.h>
#include <stdio.h>

enum { POINTS = 100 };

/* The field at one point after another; the largest value. */
static bool evaluate(ovoid_context *context, ovoid_field *field, double *largest) {
    *largest = 0.0;
    for (int k = 0; k < POINTS; ++k) {
        const double at[3] = {0.03 * k, 0.01 * k, 0.0};
        double value, gradient[3];
        if (ovoid_field_evaluate(context, field, at, 1, &value, gradient) != OVOID_OK)
            return false;
        *largest = value > *largest ? value : *largest;
    }
    return true;
}

static bool mesh(ovoid_context *context, ovoid_field *field, double *area) {
    ovoid_mesh_options options;
    ovoid_mesh *made = NULL;
    ovoid_mesh_options_init(&options, sizeof options);
    if (ovoid_field_mesh(context, field, &options, &made) != OVOID_OK)
        return false;
    *area = ovoid_mesh_smooth_area(made);
    ovoid_mesh_destroy(&made);
    return true;
}

static bool measure(ovoid_context *context, ovoid_field *original, const ovoid_molecule *molecule,
                    ovoid_measures *measures) {
    ovoid_fit_options fitting;
    ovoid_measure_options options;
    ovoid_model *model = NULL;
    ovoid_field *sparse = NULL;
    ovoid_fit_options_init(&fitting, sizeof fitting);
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(measures, sizeof *measures);
    const bool done = ovoid_fit(context, molecule, &fitting, &model, NULL) == OVOID_OK &&
                      ovoid_field_of_model(context, model, &sparse) == OVOID_OK &&
                      ovoid_measure(context, original, sparse, &options, measures) == OVOID_OK;
    ovoid_field_destroy(&sparse);
    ovoid_model_destroy(&model);
    return done;
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    ovoid_measures measures;
    double largest = 0.0, area = 0.0;
    const bool done =
        argc == 2 && ovoid_abi() == OVOID_ABI && ovoid_context_create(&context) == OVOID_OK &&
        ovoid_molecule_read(context, argv[1], OVOID_MOLECULE_AUTO, &molecule) == OVOID_OK &&
        ovoid_field_of_molecule(context, molecule, OVOID_DEFAULT_DECAY, OVOID_DEFAULT_ISOVALUE,
                                &field) == OVOID_OK &&
        evaluate(context, field, &largest) && mesh(context, field, &area) &&
        measure(context, field, molecule, &measures);
    if (done)
        printf("largest %.9g, area %.9g, area measured %.9g, deviation %.9g\n", largest, area,
               measures.area.original, measures.deviation);
    else
        fprintf(stderr, "%s\n", context ? ovoid_context_error(context) : "fields MOLECULE");
    ovoid_field_destroy(&field);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    /* What was measured is what was meshed, and the model is within the default tolerance. */
    return done && largest > 1.0 && measures.area.original == area &&
                   measures.deviation <= OVOID_DEFAULT_TOLERANCE
               ? 0
               : 1;
}
