/* Beams: all segments from a part of the cell to a part of an object, and whether bodies block them all
 * (docs/conservative.md, T5). */
#ifndef UMB_BEAM_H
#define UMB_BEAM_H

#include "shaft.h"
#include "solid.h"

/* A part of the cell or of an object: a middle and three half axes; or a triangle, whose corners are middle, axes[0] and
 * axes[1]. */
typedef struct umb_beam_part {
    double middle[3], axes[3][3];
    bool triangle;
} umb_beam_part;

/* Boxes are larger than what they stand for by this much of the reach, four times what their middles lose sideways by 64 cuts; none
 * is cut whose parts would overlap by less than that. Triangles are taken as they are: a cut moves each coordinate of a point by
 * 1.5 times 2^-53 of the reach at most, so 64 cuts move it by less than 2^-45.6, and bodies are smaller than what they stand for
 * by 2^-45.4 of it more than values of their planes are off. */
#define UMB_BEAM_MARGIN 0x1p-44

#define UMB_BEAM_BODIES 1024

umb_beam_part umb_beam_box(const double min[3], const double max[3], double more);
umb_beam_part umb_beam_triangle(const double corners[3][3]);
/* Eight; of a triangle each of its three several times. */
void umb_beam_corners(const umb_beam_part *p, double out[8][3]);
void umb_beam_bounds(const umb_beam_part *p, double min[3], double max[3]);

/* A part of a part along an axis: the share (1/4, 1/2 or 3/4) at its beginning, or the rest (upper); of a triangle along the edge from that corner.
 * Both parts of a box overlap by far more than rounding can part them; of a triangle they have the cut in common. */
umb_beam_part umb_beam_cut(const umb_beam_part *p, int axis, double share, bool upper);

typedef struct umb_beam_search {
    const umb_solids *solids;
    uint32_t effort; /* beams that may still be looked at */
    bool open;       /* set: no body meets some segment */
} umb_beam_search;

/* True if every segment from a to b is blocked. bodies: those that may meet one, at most UMB_BEAM_BODIES; their order is
 * changed. False without s->open: not decided. */
bool umb_beam_blocked(umb_beam_search *s, const umb_beam_part *a, const umb_beam_part *b, uint32_t *bodies, uint32_t count);

#endif
