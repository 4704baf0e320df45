/* Closed surfaces of whole numbers, as occluders, and what is inside them: winding numbers, slow and obvious. */
#ifndef SURFACES_H
#define SURFACES_H

#include "bake/solid.h"
#include "scene/mesh.h"
#include "support/ray_bodies.h"

enum { SURFACE_MOST = 160 };

/* Whole numbers, so that nothing of it is rounded. */
typedef struct surface {
    float points[SURFACE_MOST][3];
    uint32_t faces[SURFACE_MOST][3];
    uint8_t flags[SURFACE_MOST];
    uint32_t point_count, face_count;
} surface;

typedef struct outline {
    int8_t points[12][2];
    uint32_t count;
    uint8_t tops[10][3];
    uint32_t top_count;
} outline;

typedef struct solid_case {
    umb_allocator allocator;
    umb_occluder occluder;
    umb_mesh *mesh;
    float points[SURFACE_MOST][3]; /* in the world, of the mesh */
} solid_case;

extern const outline SQUARE, CORNER, YARD, ARROW, BOW; /* the last one crosses itself */

void add_face(surface *s, uint32_t a, uint32_t b, uint32_t c);
void add_quad(surface *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d);

/* An upright prism over an outline that goes round to the left. */
void add_outline(surface *s, const outline *o, const int shift[3], int height);

void turn_face(surface *s, uint32_t face);

/* transform NULL: where it is. */
void open_case(const surface *s, const umb_transform *t, bool mirrored, solid_case *out);
void close_case(solid_case *c);

umb_transform draw_transform(dice *d, bool mirrored);

/* How often the surface goes round a point: whole but for rounding. */
double winding(const solid_case *c, const double x[3]);

/* In a box that is a little larger. */
void point_in(dice *d, const umb_aabb *b, double out[3]);

/* How far inside the planes of a body; negative: outside. */
double depth_in(const umb_solids *s, const umb_solid *b, const double x[3]);

/* Points of bodies, their corners among them, are inside the surface; returns how many were asked about. */
uint32_t check_bodies(dice *d, const solid_case *c, const umb_solids *s);

#endif
