/* Models to GLB files. */
#ifndef WRITE_GLB_H
#define WRITE_GLB_H

#include "model.h"

/* Write m as binary glTF 2.0: a mesh of one primitive for each mesh, a node for each object, in
 * order. Reading the file again gives the same objects under the same numbers with the same
 * floats.
 *
 * glTF says one thing for a whole primitive, so a mesh of mixed triangles is written as what
 * hides least: open if any triangle is open, two-sided only if all are. Coordinates are kept as
 * they are (up is not stored); an origin becomes the translation of a root node, which readers
 * that narrow it to float before adding may round.
 *
 * On failure the file is removed and error holds one line. */
bool write_glb(const model *m, const char *file, umb_error *error);

#endif
