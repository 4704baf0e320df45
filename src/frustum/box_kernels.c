/* Choosing the box kernels, and what they need of a raster's map. */
#include "box_kernels.h"

#include <math.h>

#include "base/isa.h"

static float largest_of(const double v[3])
{
    return (float)fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
}

/* Maps that floats cannot hold get an infinite size: no box is testable then. */
static float size_of(const double v[3])
{
    float size = largest_of(v);
    return size < 1e30f ? size * (1.0f + 0x1p-20f) : INFINITY;
}

static float cut(double v)
{
    return (float)fmax(-1e30, fmin(1e30, v));
}

void umb_projector_prepare(umb_projector *p, const umb_projector_def *def)
{
    double eye = 0.0;
    for (int i = 0; i < 3; ++i) {
        p->eye_high[i] = (float)def->eye[i];
        p->eye_low[i] = (float)(def->eye[i] - p->eye_high[i]);
        p->x[i] = cut(def->x[i]);
        p->y[i] = cut(def->y[i]);
        p->w[i] = cut(def->w[i]);
        eye += fabs(def->eye[i]);
    }
    p->cx = cut(def->cx);
    p->cy = cut(def->cy);
    p->size_x = fabs(def->cx) < 1e30 ? size_of(def->x) : INFINITY;
    p->size_y = fabs(def->cy) < 1e30 ? size_of(def->y) : INFINITY;
    p->size_w = size_of(def->w);
    p->eye_size = (float)(0x1p-22 * eye);
    p->slope = def->slope;
    p->extra = def->extra;
    p->from = def->from;
    p->span = def->span;
    p->slack = def->slack;
    p->width = (float)def->width;
    p->height = (float)def->height;
    p->vertical = def->vertical;
    p->orthographic = def->orthographic;
}

const umb_box_kernels *umb_box_kernels_get(umb_isa isa)
{
    if (umb_isa_resolve(isa, &isa) != UMB_OK) {
        return NULL;
    }
    switch (isa) {
#if defined(UMB_HAVE_SSE4)
    case UMB_ISA_SSE4:
        return &umb_box_kernels_sse4;
#endif
#if defined(UMB_HAVE_AVX2)
    case UMB_ISA_AVX2:
        return &umb_box_kernels_avx2;
#endif
#if defined(UMB_HAVE_NEON)
    case UMB_ISA_NEON:
        return &umb_box_kernels_neon;
#endif
    default:
        return &umb_box_kernels_scalar;
    }
}
