/*
 * Van der Waals radii by element, angstrom.
 *
 * Main group: Mantina, Chamberlin, Valero, Cramer and Truhlar, "Consistent van der Waals radii for
 * the whole main group", J. Phys. Chem. A 113 (2009) 5806, Table 12, doi 10.1021/jp8111556: Bondi's
 * values (J. Phys. Chem. 68 (1964) 441) where he gives one, and theirs consistent with them
 * elsewhere. Of hydrogen it is Bondi's own 1.20.
 *
 * Groups 3 to 12, lanthanoids and actinoids: Alvarez, "A cartography of the van der Waals
 * territories", Dalton Trans. 42 (2013) 8617, Table 1, doi 10.1039/c3dt50599e. Bondi has values for
 * few of them, from few structures, and up to 1 angstrom less.
 */
#include "molecule/radii.h"

/* From hydrogen on; 0 where there is none. */
static const double radii[] = {
    /* H */ 1.20,  /* He */ 1.40, /* Li */ 1.81,
    /* Be */ 1.53, /* B */ 1.92,  /* C */ 1.70,
    /* N */ 1.55,  /* O */ 1.52,  /* F */ 1.47,
    /* Ne */ 1.54, /* Na */ 2.27, /* Mg */ 1.73,
    /* Al */ 1.84, /* Si */ 2.10, /* P */ 1.80,
    /* S */ 1.80,  /* Cl */ 1.75, /* Ar */ 1.88,
    /* K */ 2.75,  /* Ca */ 2.31, /* Sc */ 2.58,
    /* Ti */ 2.46, /* V */ 2.42,  /* Cr */ 2.45,
    /* Mn */ 2.45, /* Fe */ 2.44, /* Co */ 2.40,
    /* Ni */ 2.40, /* Cu */ 2.38, /* Zn */ 2.39,
    /* Ga */ 1.87, /* Ge */ 2.11, /* As */ 1.85,
    /* Se */ 1.90, /* Br */ 1.83, /* Kr */ 2.02,
    /* Rb */ 3.03, /* Sr */ 2.49, /* Y */ 2.75,
    /* Zr */ 2.52, /* Nb */ 2.56, /* Mo */ 2.45,
    /* Tc */ 2.44, /* Ru */ 2.46, /* Rh */ 2.44,
    /* Pd */ 2.15, /* Ag */ 2.53, /* Cd */ 2.49,
    /* In */ 1.93, /* Sn */ 2.17, /* Sb */ 2.06,
    /* Te */ 2.06, /* I */ 1.98,  /* Xe */ 2.16,
    /* Cs */ 3.43, /* Ba */ 2.68, /* La */ 2.98,
    /* Ce */ 2.88, /* Pr */ 2.92, /* Nd */ 2.95,
    /* Pm */ 0.00, /* Sm */ 2.90, /* Eu */ 2.87,
    /* Gd */ 2.83, /* Tb */ 2.79, /* Dy */ 2.87,
    /* Ho */ 2.81, /* Er */ 2.83, /* Tm */ 2.79,
    /* Yb */ 2.80, /* Lu */ 2.74, /* Hf */ 2.63,
    /* Ta */ 2.53, /* W */ 2.57,  /* Re */ 2.49,
    /* Os */ 2.48, /* Ir */ 2.41, /* Pt */ 2.29,
    /* Au */ 2.32, /* Hg */ 2.45, /* Tl */ 1.96,
    /* Pb */ 2.02, /* Bi */ 2.07, /* Po */ 1.97,
    /* At */ 2.02, /* Rn */ 2.20, /* Fr */ 3.48,
    /* Ra */ 2.83, /* Ac */ 2.80, /* Th */ 2.93,
    /* Pa */ 2.88, /* U */ 2.71,  /* Np */ 2.82,
    /* Pu */ 2.81, /* Am */ 2.83, /* Cm */ 3.05,
    /* Bk */ 3.40, /* Cf */ 3.05, /* Es */ 2.70,
};

double ov_radius_of_element(int element) {
    const int count = sizeof radii / sizeof radii[0];
    if (element == OV_DEUTERIUM)
        element = OV_HYDROGEN;
    return element >= 1 && element <= count ? radii[element - 1] : 0.0;
}
