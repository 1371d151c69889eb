#include <ovoid/ovoid.h>
#include <stdio.h>

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    bool done = argc == 3 && ovoid_context_create(&context) == OVOID_OK &&
                ovoid_molecule_read(context, argv[1], OVOID_MOLECULE_AUTO, &molecule) == OVOID_OK &&
                ovoid_fit(context, molecule, &options, &model, NULL) == OVOID_OK &&
                ovoid_model_write(context, model, argv[2]) == OVOID_OK;
    if (done)
        printf("%zu ellipsoids\n", ovoid_model_size(model));
    else
        fprintf(stderr, "%s\n", context ? ovoid_context_error(context) : "consumer IN OUT");
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    return done ? 0 : 1;
}
