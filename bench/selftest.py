#!/usr/bin/env python3
"""Makes each kernel wrong in turn and sees whether the self-test finds it.

selftest.py OVOID [OUTPUT.csv] [--shape VxL]...

A change of one number or sign, by a factor of 1.001 or an offset of one where that can be, is made in
a copy of kernels/, which OVOID_KERNEL_DIR makes the tool use. For every change the short form of the
self-test runs, and where that does not find it the whole one. The table has what was found by which
check; the script fails if a change is not found, does not apply, or the kernels as they are do not
pass.
"""
import argparse
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Kernel, file, what is changed (its first place in the kernel, or else in what it calls), and by what.
CHANGES = [
    ("layout", "layout.cl", "out[n++] = OFFSET(term, reach);", "out[n++] = OFFSET(term, reach) + 4;"),
    ("packs_of_terms", "lists.cl", "(least <= t.reach)", "(least <= 0.97f * t.reach)"),
    ("scan_lists", "lists.cl", "totals[2] = (uint)items.y;", "totals[2] = (uint)items.y - 1;"),
    ("hand_out_entries", "lists.cl", "item[to++] = group * OV_GROUP + ov_lowest(bits);",
     "item[to++] = group * OV_GROUP + (ov_lowest(bits) ^ 1);"),
    ("lists_of_packs", "lists.cl", "item[cursor[ov_lowest(bits)]++] = term;",
     "item[cursor[ov_lowest(bits)]++] = term ^ 1;"),
    ("make_few_lists", "lists.cl", "group_term[end] = link[at - 1].y;",
     "group_term[end] = link[at - 1].y ^ 1;"),
    ("list_reached", "gather.cl", "list[to++] = k;", "list[to++] = k + (to == 3 ? 1 : 0);"),
    ("field", "field.cl", "OV_STORE(sum[v], v *", "OV_STORE(1.00001f * sum[v], v *"),
    ("field_polynomial", "field.cl", "fma(z, (ov_vec)(c8),", "fma(z, (ov_vec)(1.001f * c8),"),
    ("field_gradient", "field.cl", "fma(x, (ov_vec)(t.xy), z * t.yz)", "fma(x, (ov_vec)(t.xy), 1.001f * z * t.yz)"),
    ("moments", "moments.cl", "sum[5] = fma(ex, y, sum[5]);", "sum[5] = fma(ex, 1.001f * y, sum[5]);"),
    ("gram", "gram.cl", "* e * e;", "* e * e * 1.001f;"),
    ("residual", "residual.cl", "const float4 r = select(held, min(held, 0.0f), t > limit);",
     "const float4 r = select(held, min(held, 0.0f), t > 1.001f * limit);"),
    ("misfit", "misfit.cl", "const float4 wr = w * r;", "const float4 wr = w * r * 1.001f;"),
    ("gather_points", "gather.cl", "copy_sixteen(xyz, 3 * from + axis, some_xyz, 3 * to + axis);",
     "copy_sixteen(xyz, 3 * from + axis, some_xyz, 3 * to + (2 - axis));"),
    ("gather_target", "gather.cl", "vstore16(vload16(from, high) - others, to, some_high);",
     "vstore16(vload16(from, high) - 1.001f * others, to, some_high);"),
    ("scatter_target", "gather.cl", "copy_sixteen(some, 3 * from + 1, high, to);",
     "copy_sixteen(some, 3 * from, high, to);"),
    ("spread", "spread.cl", "slopes[3 * point + 2] = g[2 * OV_PACK + k];",
     "slopes[3 * point + 2] = g[OV_PACK + k];"),
    ("merge_loss", "merge.cl", "const ov_vec after = squared_residual(without + value_at(tm, cm, x, y, z), l, h);",
     "const ov_vec after = squared_residual(without + 1.001f * value_at(tm, cm, x, y, z), l, h);"),
    ("solve_start", "solve.cl", "*own = matters ? fma(lambda, *own, *own) : 1.0f;",
     "*own = matters ? fma(1.5f * lambda, *own, *own) : 1.0f;"),
    ("solve_product", "solve.cl", "index < count ? multiply_one(index, lambda,",
     "index < count ? multiply_one(index, 1.2f * lambda,"),
    ("solve_update", "solve.cl", "alpha = step_length(", "alpha = 0.99f * step_length("),
    ("solve_direction", "solve.cl", "beta = before > 0.0f ? after / before : 0.0f;",
     "beta = before > 0.0f ? 0.9f * after / before : 0.0f;"),
    ("solve_step", "solve.cl", "const float beta = before > 0.0f ? after / before : 0.0f;",
     "const float beta = before > 0.0f ? 0.9f * after / before : 0.0f;"),
    ("turn_polynomials", "images.cl", "turned[5] *= 2.0f;", "turned[5] *= 2.002f;"),
    ("fold_moments", "images.cl", "sum[k] += back[k];", "sum[k] += 1.001f * back[k];"),
    ("march_signs", "march.cl", "(vload16(k, value) > isovalue)", "(vload16(k, value) > 1.05f * isovalue)"),
    ("march_count", "march.cl", "crossing[brick] = (uint4)(0, x, y, z);",
     "crossing[brick] = (uint4)(0, x, y, z & 0x7fff);"),
    ("march_number", "march.cl", "before + so_far.y);", "before + so_far.y + (so_far.x == 1 ? 1 : 0));"),
    ("march_place", "march.cl", "const float along = t[k] * spacing;",
     "const float along = 1.001f * t[k] * spacing;"),
    ("tree_leaves", "tree.cl", "box < leaves ? leaf[6 * box + k]", "box < leaves ? leaf[6 * box + k % 5]"),
    ("tree_level", "tree.cl", "for (uint i = 0; i < OV_GROUP && box < boxes; ++i)",
     "for (uint i = 1; i < OV_GROUP && box < boxes; ++i)"),
    ("march_get", "march.cl", "crossings[k] = crossing[list[k]];",
     "crossings[k] = crossing[list[k]] ^ (uint4)(1, 0, 0, 0);"),
    ("march_put", "march.cl", "crossing[list[k]] = crossings[k];",
     "crossing[list[k]] = crossings[k] + (uint4)(1, 0, 0, 0);"),
    ("march_vertices", "march.cl", "t[at] = keep_within(crossing_at(a, b, isovalue, logarithmic));",
     "t[at] = keep_within(1.001f * crossing_at(a, b, isovalue, logarithmic));"),
    ("march_boxes", "march.cl", "= (float)high[i] * spacing;", "= (float)low[i] * spacing;"),
    ("march_triangles", "march.cl", "for (uint k = 1; k <= edges; ++k, ++at) {",
     "for (uint k = 1; k <= edges; ++k, at += 1) {\n            if (item == 3 && k == 1) { corner[at] = crossing[brick].x; continue; }"),
    ("march_refine", "march.cl", "sum == isovalue ? s : s + log(max(sum, 1e-37f) / isovalue) * sum / slope;",
     "sum == isovalue ? s : s + log(max(sum, 1e-37f) / (1.001f * isovalue)) * sum / slope;"),
    ("pack_leaves", "distance.cl", "to[(6 + k) * OV_LEAF] = c - a;",
     "to[(6 + k) * OV_LEAF] = 1.001f * (c - a);"),
    ("distances", "distance.cl", "*leaf = found < bound ? child : *leaf;\n            bound = min(bound, found);",
     "*leaf = found < bound ? child : *leaf;\n            bound = min(bound, 1.001f * found);"),
    ("triangle_distances", "distance.cl", "squared[k] = ov_nearest(&corners, 3,",
     "squared[k] = 1.001f * ov_nearest(&corners, 3,"),
    ("trace", "render.cl", "    return z;\n}\n\n/* First point", "    return 1.0005f * z;\n}\n\n/* First point"),
    ("trace_ellipsoids", "render.cl", "const ov_vec met = dz + t.z;", "const ov_vec met = 1.001f * dz + t.z;"),
    ("compare", "render.cl", "(sum - level) / max(steep, 1e-6f)", "(sum - 1.01f * level) / max(steep, 1e-6f)"),
    ("shade", "render.cl", "const float soft = fill.w * (0.5f + 0.5f * dot(n, to_fill));",
     "const float soft = fill.w * (0.4f + 0.5f * dot(n, to_fill));"),
]


def change(kernel, file, old, new, folder):
    """Writes kernels/ with the change to the folder; False where it does not apply."""
    for source in (ROOT / "kernels").iterdir():
        text = source.read_text()
        if source.name == file:
            start = text.find(kernel + "(")
            at = text.find(old, start) if start >= 0 else -1
            at = text.find(old) if at < 0 else at
            if at < 0:
                return False
            text = text[:at] + new + text[at + len(old):]
        (folder / source.name).write_text(text)
    return True


def selftest(ovoid, folder, shape, short):
    """The checks that did not pass, as (name, text); whether the tool said so with its exit code."""
    environment = dict(os.environ, OVOID_KERNEL_DIR=str(folder), OVOID_CACHE="off")
    if shape:
        environment["OVOID_SHAPE"] = shape
    command = [ovoid, "selftest", "--json"] + (["--short"] if short else [])
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    try:
        checks = json.loads(done.stdout)["checks"]
    except (ValueError, KeyError):
        return [("", done.stderr.strip())], done.returncode
    wrong = [(check["name"], check["text"]) for check in checks if check["verdict"] != "passed"]
    return wrong, done.returncode


def try_change(ovoid, shape, kernel, file, old, new):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        if not change(kernel, file, old, new, folder):
            return "", "does not apply", ""
        for short in (True, False):
            wrong, code = selftest(ovoid, folder, shape, short)
            if wrong:
                break
        if not wrong:
            return "", "not found", ""
        outcome = "found" if code == 5 else f"exit code {code}"
        return "short" if short else "whole", outcome, "; ".join(f"{n}: {t}" for n, t in wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ovoid")
    parser.add_argument("output", nargs="?")
    parser.add_argument("--shape", action="append", default=[], help="of the kernels (OVOID_SHAPE)")
    parser.add_argument("--kernel", action="append", default=[], help="these alone")
    arguments = parser.parse_args()
    out = open(arguments.output, "w", newline="") if arguments.output else sys.stdout
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["shape", "kernel", "changed to", "form", "outcome", "what the self-test says"])
    bad = 0
    for shape in arguments.shape or [""]:
        with tempfile.TemporaryDirectory() as name:
            change("", "", "", "", pathlib.Path(name))
            if selftest(arguments.ovoid, name, shape, True)[0]:
                sys.exit("the kernels as they are do not pass")
        for kernel, file, old, new in CHANGES:
            if arguments.kernel and kernel not in arguments.kernel:
                continue
            form, outcome, text = try_change(arguments.ovoid, shape, kernel, file, old, new)
            table.writerow([shape or "own", kernel, " ".join(new.split()), form, outcome, text])
            out.flush()
            bad += outcome != "found"
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
