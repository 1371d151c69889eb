/*
 * Symmetric assemblies: the motions that carry one into itself (host/molecule/symmetry), and fits
 * of one unit among its images that stand for all of them.
 */
#include "base/rigid.h"
#include "field/quadric.h"
#include "measure/survey.h"
#include "molecule/symmetry.h"
#include "support.h"

#include <unistd.h>

#define TOLERANCE 0.5

static const double PI = 3.14159265358979323846;

/* About the z axis, and along it. */
static ov_rigid screw(double turns, double along) {
    const double c = cos(2.0 * PI * turns), s = sin(2.0 * PI * turns);
    return (ov_rigid){.rotation = {c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0},
                      .shift = {0.0, 0.0, along}};
}

/* Half a turn about the x axis. */
static const ov_rigid flip = {.rotation = {1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0}};

/* A PQR file of `atoms` atoms, as dense as a protein's, in a ball about (x, y, z), with an assembly
 * of these placements. */
static ovoid_molecule *assembly(ovoid_context *context, size_t atoms, double x, double y, double z,
                                const ov_rigid *placements, size_t count) {
    char path[] = "symmetry.pqr";
    FILE *const file = fopen(path, "w");
    test_random random = {5};
    ovoid_read_options options;
    ovoid_molecule *molecule = NULL;
    const double half = 0.5 * cbrt(10.0 * (double)atoms);
    assert_non_null(file);
    fprintf(file, "REMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n");
    for (size_t p = 0; p < count; ++p)
        for (int k = 0; k < 3; ++k) {
            const double *const row = placements[p].rotation + 3 * k;
            fprintf(file, "REMARK 350   BIOMT%d %3zu %13.9f %13.9f %13.9f %14.8f\n", k + 1, p + 1,
                    row[0], row[1], row[2], placements[p].shift[k]);
        }
    for (size_t i = 0; i < atoms; ++i) {
        const double at[3] = {x + random_uniform(&random, -half, half),
                              y + random_uniform(&random, -half, half),
                              z + random_uniform(&random, -half, half)};
        fprintf(file, "ATOM  %5zu  C   ALA A %3zu    %8.3f %8.3f %8.3f %6.3f %6.3f\n", i + 1,
                i / 8 + 1, at[0], at[1], at[2], 0.0, random_uniform(&random, 1.2, 1.8));
    }
    fclose(file);
    ovoid_read_options_init(&options, sizeof options);
    options.assembly = "1";
    test_check(context, ovoid_molecule_read_with(context, path, &options, &molecule));
    unlink(path);
    return molecule;
}

/* ---- motions --------------------------------------------------------------------------------- */

/* The motions make all atoms of the assembly, each once, of those of the unit. */
static void expect_all_made(ovoid_context *context, const ovoid_molecule *molecule,
                            const ov_symmetry *symmetry) {
    const double *const all = ovoid_molecule_xyzr(molecule);
    bool *const made = test_alloc(ovoid_molecule_atoms(molecule), sizeof *made);
    double *unit = NULL;
    test_check(context, ov_symmetry_unit(context, molecule, symmetry, &unit));
    assert_int_equal(symmetry->order * symmetry->unit_atoms, ovoid_molecule_atoms(molecule));
    for (size_t g = 0; g < symmetry->order; ++g) {
        const double *from = unit;
        for (size_t u = 0; u < symmetry->units; ++u)
            for (size_t n = 0; n < symmetry->atoms[u]; ++n, from += 4) {
                const size_t atom = symmetry->first[g * symmetry->units + u] + n;
                double moved[3];
                ov_rigid_move(&symmetry->motion[g], from, moved);
                for (size_t k = 0; k < 3; ++k)
                    expect_near(moved[k], all[4 * atom + k], 1e-5, "a coordinate");
                assert_false(made[atom]);
                made[atom] = true;
            }
    }
    free(unit);
    free(made);
}

static void expect_symmetry(ovoid_context *context, const ov_rigid *placements, size_t count,
                            size_t order, size_t units) {
    ovoid_molecule *molecule = assembly(context, 20, 30.0, 4.0, 9.0, placements, count);
    ov_symmetry symmetry = {0};
    test_check(context, ov_symmetry_find(context, molecule, &symmetry));
    assert_int_equal(symmetry.order, order);
    assert_int_equal(symmetry.units, units);
    if (order > 0) {
        assert_memory_equal(&symmetry.motion[0], &ov_rigid_identity, sizeof ov_rigid_identity);
        expect_all_made(context, molecule, &symmetry);
    }
    ov_symmetry_destroy(&symmetry);
    ovoid_molecule_destroy(&molecule);
}

static void groups_are_found(void **state) {
    ov_rigid of[12];
    for (size_t n = 0; n < 5; ++n)
        of[n] = screw((double)n / 5.0, 0.0);
    expect_symmetry(*state, of, 5, 5, 1);
    for (size_t n = 0; n < 6; ++n) { /* D3: three turns, and each of them flipped */
        const ov_rigid turn = screw((double)(n % 3) / 3.0, 0.0);
        of[n] = n < 3 ? turn : ov_rigid_after(&turn, &flip);
    }
    expect_symmetry(*state, of, 6, 6, 1);
    expect_symmetry(*state, of, 1, 1, 1);
}

/* Placements that are no group: the unit is what is left of them when the group's are taken. */
static void units_of_several_placements_are_found(void **state) {
    ov_rigid of[8];
    for (size_t n = 0; n < 8; ++n) /* two rings of four, turned against each other */
        of[n] = screw(0.25 * (double)(n % 4) + (n < 4 ? 0.0 : 0.07), n < 4 ? 0.0 : 40.0);
    expect_symmetry(*state, of, 8, 4, 2);
    for (size_t n = 0; n < 5; ++n) /* a stretch of a helix: its ends differ from its middle */
        of[n] = screw(0.28 * (double)n, 12.0 * (double)n);
    expect_symmetry(*state, of, 5, 1, 5);
    for (size_t n = 0; n < 4; ++n) /* a ring with a gap */
        of[n] = screw(0.2 * (double)n, 0.0);
    expect_symmetry(*state, of, 4, 1, 4);
    of[0] = of[1] = ov_rigid_identity; /* the same twice is no symmetry */
    expect_symmetry(*state, of, 2, 0, 0);
}

/* ---- surveys --------------------------------------------------------------------------------- */

/* Surveys the unit of a ring of `order` among its images; the model is the atoms a little shifted.
 */
static void survey_unit(ovoid_context *context, const ovoid_molecule *molecule,
                        const ov_rigid *motions, size_t order, ov_survey_total *total) {
    const size_t unit = ovoid_molecule_unit_atoms(molecule);
    const double low[3] = {-INFINITY, -INFINITY, -INFINITY},
                 high[3] = {INFINITY, INFINITY, INFINITY};
    const double centre[3] = {0.0, 0.0, 0.0};
    ov_quadric *const original = test_alloc(order * unit, sizeof *original);
    ov_quadric *const model = test_alloc(order * unit, sizeof *model);
    uint32_t *const image = test_alloc(order * unit, sizeof *image);
    ov_survey_cell cell = {0};
    for (size_t n = 0; n < order * unit; ++n) {
        ov_quadric atom;
        image[n] = (uint32_t)(n / unit);
        ov_quadric_of_atom(ovoid_molecule_unit_xyzr(molecule) + 4 * (n % unit), 0.5, &atom);
        ov_quadric_move(&atom, &motions[n / unit], &original[n]);
        atom.centre[n % unit % 3] += 0.4 * sin((double)(n % unit));
        ov_quadric_move(&atom, &motions[n / unit], &model[n]);
    }
    const ov_survey_options options = {
        .isovalue = 1.0, .spacing = 0.5, .least = INFINITY, .image = image};
    const ov_survey_images images = {
        .image = motions, .count = order, .spacing = 0.5, .centre = centre};
    test_check(context, ov_survey(context, &options, original, order * unit, model, order * unit,
                                  low, high, &cell));
    test_check(context, ov_survey_join(context, &cell, 1, &images, 3.0, total));
    ov_survey_cell_destroy(&cell);
    free(original);
    free(model);
    free(image);
}

/* So many units are the whole, but for the lattice that each is meshed on: what is outer, and which
 * cavities there are, is known across the seams. */
static void units_add_up(void **state) {
    const ov_rigid of[3] = {screw(0.0, 0.0), screw(1.0 / 3.0, 0.0), screw(2.0 / 3.0, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 700, 11.0, 0.0, 50.0, of, 3);
    ov_survey_total total = {0};
    ovoid_field *field = NULL;
    ovoid_measure_options options;
    ovoid_measures whole;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(&whole, sizeof whole);
    test_skip_simulated(*state);
    survey_unit(*state, molecule, of, 3, &total);
    test_check(*state, ovoid_field_of_molecule(*state, molecule, 0.5, 1.0, &field));
    test_check(*state, ovoid_measure(*state, field, field, &options, &whole));
    print_message("outer area %g of %g, outer volume %g of %g, %llu pieces of %llu\n",
                  3.0 * total.area_outer[0], whole.area_outer.original, 3.0 * total.volume_outer[0],
                  whole.volume_outer.original, (unsigned long long)total.components[0],
                  (unsigned long long)whole.components_original);
    assert_int_equal(whole.outer_original, 1);
    assert_true(whole.components_original > 1);
    expect_near(3.0 * total.area[0], whole.area.original, 2e-3 * whole.area.original, "area");
    expect_near(3.0 * total.volume[0], whole.volume.original, 2e-3 * whole.volume.original,
                "volume");
    expect_near(3.0 * total.area_outer[0], whole.area_outer.original,
                2e-3 * whole.area_outer.original, "outer area");
    expect_near(3.0 * total.volume_outer[0], whole.volume_outer.original,
                2e-3 * whole.volume_outer.original, "outer volume");
    assert_int_equal(total.outer[0], 1);
    ov_survey_total_destroy(&total);
    ovoid_field_destroy(&field);
    ovoid_molecule_destroy(&molecule);
}

/* ---- measures -------------------------------------------------------------------------------- */

/* The unit's atoms as ellipsoids, each somewhere else by up to so much, and all of them turned
 * about the axis. */
static ovoid_model *placed_model(ovoid_context *context, const ovoid_molecule *molecule,
                                 const ov_rigid *motions, size_t order, double off, double turns) {
    const size_t unit = ovoid_molecule_unit_atoms(molecule);
    const ov_rigid turn = screw(turns, 0.0);
    ovoid_ellipsoid *const of = test_alloc(unit, sizeof *of);
    ovoid_motion *const placements = test_alloc(order, sizeof *placements);
    ovoid_model *model = NULL;
    for (size_t n = 0; n < unit; ++n) {
        const double *const atom = ovoid_molecule_unit_xyzr(molecule) + 4 * n;
        of[n] = (ovoid_ellipsoid){.amplitude = exp(0.5 * atom[3] * atom[3]),
                                  .decay = {0.55, 0.5, 0.45},
                                  .angle = {0.1 * (double)n, 0.3, 0.7}};
        ov_rigid_move(&turn, atom, of[n].centre);
        of[n].centre[n % 3] += off * sin((double)n);
    }
    for (size_t g = 0; g < order; ++g) {
        memcpy(placements[g].rotation, motions[g].rotation, sizeof motions[g].rotation);
        memcpy(placements[g].translation, motions[g].shift, sizeof motions[g].shift);
    }
    test_check(context,
               ovoid_model_create_placed(context, of, unit, placements, order, 0.5, 1.0, &model));
    free(of);
    free(placements);
    return model;
}

static ovoid_measures compare(ovoid_context *context, const ovoid_molecule *molecule,
                              const ovoid_model *model, uint32_t cell_atoms) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measure_options options;
    ovoid_measures measures;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(&measures, sizeof measures);
    options.cell_atoms = cell_atoms;
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, model, &sparse));
    test_check(context, ovoid_measure(context, original, sparse, &options, &measures));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return measures;
}

static void expect_pair(ovoid_pair got, ovoid_pair wanted, double share, const char *what) {
    expect_near(got.original, wanted.original, share * wanted.original, what);
    expect_near(got.sparse, wanted.sparse, share * wanted.sparse, what);
}

static void expect_distances(const ovoid_distances *got, const ovoid_distances *wanted) {
    expect_near(got->forward, wanted->forward, 0.15, "a distance");
    expect_near(got->backward, wanted->backward, 0.15, "a distance");
    expect_near(got->mean, wanted->mean, 1e-2 * wanted->mean, "a mean distance");
    expect_near(got->rms, wanted->rms, 1e-2 * wanted->rms, "a root mean square distance");
}

static void expect_same_measures(const ovoid_measures *got, const ovoid_measures *wanted) {
    print_message(
        "pieces %llu %llu (outer %llu %llu) of %llu %llu (%llu %llu), area %g of %g, "
        "deviation %g of %g, outer mean %g of %g\n",
        (unsigned long long)got->components_original, (unsigned long long)got->components_sparse,
        (unsigned long long)got->outer_original, (unsigned long long)got->outer_sparse,
        (unsigned long long)wanted->components_original,
        (unsigned long long)wanted->components_sparse, (unsigned long long)wanted->outer_original,
        (unsigned long long)wanted->outer_sparse, got->area.original, wanted->area.original,
        got->deviation, wanted->deviation, got->distances_outer.mean, wanted->distances_outer.mean);
    assert_int_equal(got->outer_original, wanted->outer_original);
    assert_int_equal(got->outer_sparse, wanted->outer_sparse);
    expect_pair(got->area, wanted->area, 2e-3, "area");
    expect_pair(got->volume, wanted->volume, 2e-3, "volume");
    expect_pair(got->area_outer, wanted->area_outer, 2e-3, "outer area");
    expect_pair(got->volume_outer, wanted->volume_outer, 2e-3, "outer volume");
    expect_distances(&got->distances, &wanted->distances);
    expect_distances(&got->distances_outer, &wanted->distances_outer);
    expect_near(got->deviation, wanted->deviation, 0.15, "deviation");
}

/* What a unit among its images says of all of it, against the whole of it. */
static ovoid_measures expect_measured_by_unit(ovoid_context *context,
                                              const ovoid_molecule *molecule,
                                              const ov_rigid *motions, size_t order, double off,
                                              double turns) {
    const uint32_t unit = (uint32_t)ovoid_molecule_unit_atoms(molecule);
    const uint32_t sizes[] = {unit, unit / 5};
    ovoid_model *placed = placed_model(context, molecule, motions, order, off, turns);
    ovoid_model *all = NULL;
    test_check(context, ovoid_model_expand(context, placed, &all));
    const ovoid_measures wanted = compare(context, molecule, all, 0);
    for (size_t k = 0; k < 2; ++k) {
        const ovoid_measures got = compare(context, molecule, placed, sizes[k]);
        const double more = fabs(got.area.original - wanted.area.original);
        expect_same_measures(&got, &wanted);
        assert_true(more > 1e-8 * wanted.area.original); /* of another lattice */
    }
    ovoid_model_destroy(&placed);
    ovoid_model_destroy(&all);
    return wanted;
}

static void measures_are_those_of_the_whole(void **state) {
    const ov_rigid of[3] = {screw(0.0, 0.0), screw(1.0 / 3.0, 0.0), screw(2.0 / 3.0, 0.0)};
    test_skip_simulated(*state);
    ovoid_molecule *molecule = assembly(*state, 700, 11.0, 0.0, 50.0, of, 3);
    expect_measured_by_unit(*state, molecule, of, 3, 0.4, 0.0);
    ovoid_molecule_destroy(&molecule);
}

/* Pairs across an axis of two, three of them: how many there are is known of none of them. */
static void pieces_across_seams_are_counted(void **state) {
    ov_rigid of[6];
    test_skip_simulated(*state);
    for (size_t n = 0; n < 6; ++n) {
        const ov_rigid turn = screw((double)(n % 3) / 3.0, 0.0);
        of[n] = n < 3 ? turn : ov_rigid_after(&flip, &turn);
    }
    ovoid_molecule *molecule = assembly(*state, 150, 40.0, 3.0, 2.0, of, 6);
    const ovoid_measures whole = expect_measured_by_unit(*state, molecule, of, 6, 0.3, 0.0);
    assert_int_equal(whole.outer_original, 3);
    ovoid_molecule_destroy(&molecule);
}

/* The model's units lie between those of the molecule, each as near to an image. */
static void what_is_far_is_found_in_images(void **state) {
    ov_rigid of[4];
    test_skip_simulated(*state);
    for (size_t n = 0; n < 4; ++n)
        of[n] = screw(0.25 * (double)n, 0.0);
    ovoid_molecule *molecule = assembly(*state, 120, 60.0, 0.0, 0.0, of, 4);
    const ovoid_measures whole = expect_measured_by_unit(*state, molecule, of, 4, 0.0, 0.14);
    assert_true(whole.deviation > 6.0);
    ovoid_molecule_destroy(&molecule);
}

/* An ellipsoid that no atom is near is of no unit: all of them are measured. */
static void what_is_of_no_unit_is_measured(void **state) {
    const ov_rigid of[2] = {screw(0.0, 0.0), screw(0.5, 0.0)};
    test_skip_simulated(*state);
    ovoid_molecule *molecule = assembly(*state, 60, 15.0, 0.0, 0.0, of, 2);
    ovoid_model *near = placed_model(*state, molecule, of, 2, 0.3, 0.0), *far = NULL, *all = NULL;
    ovoid_ellipsoid *const unit = test_alloc(60, sizeof *unit);
    memcpy(unit, ovoid_model_unit_ellipsoids(near), 60 * sizeof *unit);
    unit[7].centre[2] += 200.0;
    test_check(*state,
               ovoid_model_create_placed(*state, unit, 60, ovoid_model_placements(near, NULL), 2,
                                         0.5, 1.0, &far));
    test_check(*state, ovoid_model_expand(*state, far, &all));
    const ovoid_measures got = compare(*state, molecule, far, 30),
                         wanted = compare(*state, molecule, all, 0);
    expect_same_measures(&got, &wanted);
    assert_int_equal(got.outer_sparse, got.outer_original + 2);
    assert_true(got.deviation > 150.0);
    free(unit);
    ovoid_model_destroy(&near);
    ovoid_model_destroy(&far);
    ovoid_model_destroy(&all);
    ovoid_molecule_destroy(&molecule);
}

/* ---- fits ------------------------------------------------------------------------------------ */

static ovoid_model *fit(ovoid_context *context, const ovoid_molecule *molecule,
                        const ovoid_fit_options *options, ovoid_fit_result *result) {
    ovoid_model *model = NULL;
    ovoid_fit_result_init(result, sizeof *result);
    test_check(context, ovoid_fit(context, molecule, options, &model, result));
    return model;
}

static double deviation(ovoid_context *context, const ovoid_molecule *molecule,
                        const ovoid_model *model) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measure_options options;
    ovoid_measures measures;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(&measures, sizeof measures);
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, model, &sparse));
    test_check(context, ovoid_measure(context, original, sparse, &options, &measures));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return measures.deviation;
}

/* Unit after unit, each where a motion takes the first. */
static void expect_repeated(const ovoid_model *model, const ov_rigid *motions, size_t units) {
    const ovoid_ellipsoid *const of = ovoid_model_ellipsoids(model);
    const size_t each = ovoid_model_size(model) / units;
    assert_int_equal(ovoid_model_size(model), each * units);
    for (size_t n = 0; n < each * units; ++n) {
        const ovoid_ellipsoid *const first = &of[n % each];
        double moved[3];
        ov_rigid_move(&motions[n / each], first->centre, moved);
        for (size_t k = 0; k < 3; ++k) {
            expect_near(of[n].centre[k], moved[k], 1e-6, "a centre");
            expect_near(of[n].decay[k], first->decay[k], 1e-6 * first->decay[k], "a decay rate");
        }
        assert_true(of[n].amplitude == first->amplitude);
    }
}

/* Units this far from the axis that they stand about: the goal holds at their seams, too, as a
 * measure of the whole has it. Its lattice lies otherwise in each unit, so that it sees a little
 * more. */
static void expect_units_stand_for_all(ovoid_context *context, size_t units, size_t atoms,
                                       double from_axis, uint32_t part_atoms) {
    ov_rigid of[6];
    for (size_t n = 0; n < units; ++n)
        of[n] = screw((double)n / (double)units, 0.0);
    ovoid_molecule *molecule = assembly(context, atoms, from_axis, 0.0, 50.0, of, units);
    ovoid_fit_options options;
    ovoid_fit_result result, again;
    ovoid_fit_options_init(&options, sizeof options);
    options.parts.atoms = part_atoms;
    ovoid_model *model = fit(context, molecule, &options, &result);
    const double apart = deviation(context, molecule, model);
    print_message("%zu ellipsoids for %zu atoms, within %g, measured as a whole %g\n",
                  ovoid_model_size(model), units * atoms, result.distance, apart);
    assert_int_equal(result.units, units);
    assert_true(part_atoms == 0 || result.parts > 1);
    assert_int_equal(result.ellipsoids, ovoid_model_size(model));
    assert_true(result.reached && result.distance <= TOLERANCE);
    assert_true(apart <= 1.3 * TOLERANCE);
    expect_repeated(model, of, units);
    assert_int_equal(expect_owners(molecule, model, 8, 0.9), 0);
    options.parts.jobs = 2;
    ovoid_model *other = fit(context, molecule, &options, &again);
    expect_same_models(model, other);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&other);
    ovoid_molecule_destroy(&molecule);
}

/* Both surfaces, as a file of the model gives them back. */
static ovoid_measures measure_file(ovoid_context *context, const ovoid_molecule *molecule,
                                   const ovoid_model *model) {
    ovoid_model *again = NULL;
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measure_options options;
    ovoid_measures measures;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(&measures, sizeof measures);
    test_check(context, ovoid_model_write(context, model, "symmetry.ovoid"));
    test_check(context, ovoid_model_read(context, "symmetry.ovoid", &again));
    unlink("symmetry.ovoid");
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, again, &sparse));
    assert_int_equal(ovoid_field_terms(sparse), ovoid_model_size(model));
    test_check(context, ovoid_measure(context, original, sparse, &options, &measures));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    ovoid_model_destroy(&again);
    return measures;
}

/* A fit gives the unit and its motions, which expanded are all there is. */
static void models_are_units_and_motions(void **state) {
    const ov_rigid of[3] = {screw(0.0, 0.0), screw(1.0 / 3.0, 0.0), screw(2.0 / 3.0, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 100, 8.0, 0.0, 0.0, of, 3);
    ovoid_fit_options options;
    ovoid_fit_result result;
    ovoid_model *all = NULL;
    size_t placements;
    test_skip_simulated(*state);
    ovoid_fit_options_init(&options, sizeof options);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 30;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    const ovoid_motion *const motions = ovoid_model_placements(model, &placements);
    assert_int_equal(placements, 3);
    for (size_t n = 0; n < 3; ++n) {
        for (size_t k = 0; k < 9; ++k)
            expect_near(motions[n].rotation[k], of[n].rotation[k], 1e-9, "a rotation");
        for (size_t k = 0; k < 3; ++k)
            expect_near(motions[n].translation[k], of[n].shift[k], 1e-8, "a translation");
    }
    assert_int_equal(ovoid_model_unit_size(model), 10);
    test_check(*state, ovoid_model_expand(*state, model, &all));
    expect_repeated(all, of, 3);
    expect_same_models(model, all);
    const ovoid_measures placed = measure_file(*state, molecule, model);
    const ovoid_measures expanded = measure_file(*state, molecule, all);
    expect_near(placed.area.sparse, expanded.area.sparse, 1e-5 * expanded.area.sparse, "area");
    expect_near(placed.volume.sparse, expanded.volume.sparse, 1e-5 * expanded.volume.sparse,
                "volume");
    expect_near(placed.deviation, expanded.deviation, 1e-4, "deviation");
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&all);
    ovoid_molecule_destroy(&molecule);
}

/* Of so many ellipsoids what is off is brought near within units and where images of one meet. */
static void units_are_sharpened(void **state) {
    const ov_rigid of[3] = {screw(0.0, 0.0), screw(1.0 / 3.0, 0.0), screw(2.0 / 3.0, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 150, 8.0, 0.0, 0.0, of, 3);
    double deviation[2];
    test_skip_simulated(*state);
    for (uint32_t effort = 0; effort < 2; ++effort) {
        ovoid_fit_options options;
        ovoid_fit_result result;
        ovoid_fit_options_init(&options, sizeof options);
        options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
        options.adaptive.ellipsoids = 60;
        options.adaptive.effort = effort;
        ovoid_model *model = fit(*state, molecule, &options, &result);
        assert_int_equal(ovoid_model_unit_size(model), 20);
        deviation[effort] = measure_file(*state, molecule, model).deviation;
        if (effort > 0)
            expect_near(result.distance, deviation[effort], 0.1, "distance"); /* of the unit */
        ovoid_model_destroy(&model);
    }
    print_message("within %g A instead of %g\n", deviation[1], deviation[0]);
    assert_true(deviation[1] <= 0.8 * deviation[0]);
    ovoid_molecule_destroy(&molecule);
}

static void units_stand_for_all(void **state) {
    const size_t atoms = 250;
    test_skip_simulated(*state);
    expect_units_stand_for_all(*state, 3, atoms, 0.5 * cbrt(10.0 * (double)atoms) + 1.0, 64);
}

/* So near to the axis that ellipsoids overlap their own images, which they move with: several of
 * them, where as many units meet. */
static void seams_at_an_axis_are_mended(void **state) {
    test_skip_simulated(*state);
    expect_units_stand_for_all(*state, 3, test_size(250, 120), 4.0, 0);
    for (size_t units = 3; units <= test_size(6, 4); ++units)
        expect_units_stand_for_all(*state, units, test_size(250, 120), 6.0, 0);
}

static void expect_units(ovoid_context *context, const ovoid_molecule *molecule,
                         const ovoid_fit_options *options, uint64_t units, size_t ellipsoids) {
    ovoid_fit_result result;
    ovoid_model *model = fit(context, molecule, options, &result);
    assert_int_equal(result.units, units);
    assert_int_equal(ovoid_model_size(model), ellipsoids);
    assert_true(result.reached);
    ovoid_model_destroy(&model);
}

/* So many as are asked for: by unit where that goes, else by all atoms. */
static void numbers_are_those_asked_for(void **state) {
    const ov_rigid of[2] = {screw(0.0, 0.0), screw(0.5, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 100, 8.0, 0.0, 0.0, of, 2);
    ovoid_fit_options options;
    ovoid_model *none = NULL;
    ovoid_fit_options_init(&options, sizeof options);
    test_skip_simulated(*state);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 20;
    expect_units(*state, molecule, &options, 2, 20);
    options.adaptive.ellipsoids = 21;
    expect_units(*state, molecule, &options, 1, 21);
    options.adaptive.ellipsoids = 20;
    options.parts.symmetry = OVOID_SYMMETRY_IGNORE;
    expect_units(*state, molecule, &options, 1, 20);
    options.parts.symmetry = OVOID_SYMMETRY_IGNORE + 1;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "parts.symmetry must be one of");
    ovoid_molecule_destroy(&molecule);
}

/* A session goes on with all atoms where a model is what it begins with. */
static void sessions_go_on_with_all_atoms(void **state) {
    const ov_rigid of[2] = {screw(0.0, 0.0), screw(0.5, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 100, 8.0, 0.0, 0.0, of, 2);
    ovoid_fit_options options;
    ovoid_fit_result result;
    ovoid_fitter *fitter = NULL;
    ovoid_model *model = NULL, *next = NULL;
    ovoid_fit_options_init(&options, sizeof options);
    ovoid_fit_result_init(&result, sizeof result);
    test_skip_simulated(*state);
    test_check(*state, ovoid_fitter_create(*state, molecule, &options, &fitter));
    test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &model, &result));
    assert_int_equal(result.units, 2);
    test_check(*state, ovoid_fitter_start_from(*state, fitter, model));
    test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &next, &result));
    assert_int_equal(result.units, 1);
    assert_true(result.reached);
    ovoid_fitter_destroy(&fitter);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&next);
    ovoid_molecule_destroy(&molecule);
}

/* The model of a unit goes along with all atoms. */
static void frames_go_on_with_all_atoms(void **state) {
    const ov_rigid of[2] = {screw(0.0, 0.0), screw(0.5, 0.0)};
    ovoid_molecule *molecule = assembly(*state, 60, 7.0, 0.0, 0.0, of, 2);
    ovoid_fit_options options;
    ovoid_fit_result first, result;
    ovoid_fitter *fitter = NULL;
    ovoid_model *model = NULL, *next = NULL;
    double *const xyz = test_alloc(3 * ovoid_molecule_atoms(molecule), sizeof *xyz);
    test_skip_simulated(*state);
    ovoid_fit_options_init(&options, sizeof options);
    ovoid_fit_result_init(&first, sizeof first);
    ovoid_fit_result_init(&result, sizeof result);
    for (size_t i = 0; i < 3 * ovoid_molecule_atoms(molecule); ++i)
        xyz[i] = ovoid_molecule_xyzr(molecule)[4 * (i / 3) + i % 3] + 5.0;
    test_check(*state, ovoid_fitter_create(*state, molecule, &options, &fitter));
    test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &model, &first));
    assert_int_equal(first.units, 2);
    test_check(*state, ovoid_fitter_move(*state, fitter, xyz));
    test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &next, &result));
    assert_int_equal(result.units, 1);
    assert_true(result.reached);
    assert_int_equal(ovoid_model_size(next), ovoid_model_size(model));
    assert_memory_equal(ovoid_model_owner(next), ovoid_model_owner(model),
                        ovoid_model_owner_count(model) * sizeof(uint32_t));
    for (size_t i = 0; i < ovoid_model_size(next); ++i)
        for (size_t k = 0; k < 3; ++k)
            expect_near(ovoid_model_ellipsoids(next)[i].centre[k],
                        ovoid_model_ellipsoids(model)[i].centre[k] + 5.0, 2.0, "a centre");
    ovoid_fitter_destroy(&fitter);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&next);
    ovoid_molecule_destroy(&molecule);
    free(xyz);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(groups_are_found),
        cmocka_unit_test(units_of_several_placements_are_found),
        cmocka_unit_test(units_add_up),
        cmocka_unit_test(measures_are_those_of_the_whole),
        cmocka_unit_test(pieces_across_seams_are_counted),
        cmocka_unit_test(what_is_far_is_found_in_images),
        cmocka_unit_test(what_is_of_no_unit_is_measured),
        cmocka_unit_test(models_are_units_and_motions),
        cmocka_unit_test(units_are_sharpened),
        cmocka_unit_test(units_stand_for_all),
        cmocka_unit_test(seams_at_an_axis_are_mended),
        cmocka_unit_test(numbers_are_those_asked_for),
        cmocka_unit_test(sessions_go_on_with_all_atoms),
        cmocka_unit_test(frames_go_on_with_all_atoms),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
