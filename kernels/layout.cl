/*
 * Reports the sizes and offsets that this device gives to the structures of shared.h, for the host
 * to compare with its own.
 */

/* The offsets are measured on an object rather than with a null pointer, which some compilers
 * refuse to fold. */
#define OFFSET(object, member) (uint)((const char *)&(object).member - (const char *)&(object))

/* out: sizes and offsets in the order of ov_layout_of_host(); one work-item. */
kernel void layout(global uint *out) {
    ov_term term;
    ov_tree tree;
    uint n = 0;
    if (get_global_id(0))
        return;
    out[n++] = sizeof(ov_term);
    out[n++] = OFFSET(term, log2_amplitude);
    out[n++] = OFFSET(term, x);
    out[n++] = OFFSET(term, y);
    out[n++] = OFFSET(term, z);
    out[n++] = OFFSET(term, xx);
    out[n++] = OFFSET(term, xy);
    out[n++] = OFFSET(term, xz);
    out[n++] = OFFSET(term, yy);
    out[n++] = OFFSET(term, yz);
    out[n++] = OFFSET(term, zz);
    out[n++] = OFFSET(term, rest_x);
    out[n++] = OFFSET(term, rest_y);
    out[n++] = OFFSET(term, rest_z);
    out[n++] = OFFSET(term, reach);
    out[n++] = OFFSET(term, skin);
    out[n++] = sizeof(ov_tree);
    out[n++] = OFFSET(tree, levels);
    out[n++] = OFFSET(tree, boxes);
    out[n++] = OFFSET(tree, groups);
    out[n++] = OFFSET(tree, padding);
    out[n++] = OV_PACK;
    out[n++] = OV_GROUP;
    out[n++] = OV_LEVELS;
    out[n++] = OV_MONOMIALS;
}
