/* Slopes to a body that does not stand upright: in most pixels less than those to its highest and lowest points.
 *
 * Seen from (u0, z0), a point of the body has the picture x = f / (u - u0), y = (z - z0) / (u - u0), where f is its offset
 * from one line of the map: with u0 = ua and z0 = z1 the height y is a bound of m. The picture of a convex body is convex.
 * Lines of a pixel meet points with |x - x0| <= w only, x0 being the middle line's. So a line of any slope k that touches the
 * picture from above bounds y there:
 *
 *              .-'-.              y <= max (yc - k (xc - x0)) + |k| w    over the body's corners c.
 *           .-' | | '.
 *          <__  | |   '.          The least bound is by the slope of a side of the picture, so those of all sides are tried.
 *             '-|_|__.-'          M is bounded in the same way, from (ub, z0) and upside down.
 *               x0+-w
 */
#include "ray_tilt.h"

#include <math.h>

#define SLACK 0x1p-44
#define STEEPEST 1e6 /* sides of the picture are not worth trying */

typedef struct sides {
    double slopes[UMB_UMBRA_CORNERS];
    uint32_t count;
    umb_ray_point corners[UMB_UMBRA_CORNERS];          /* the picture: u is x and v is y */
    double per_s[UMB_UMBRA_CORNERS], per_t[UMB_UMBRA_CORNERS]; /* what x is less on lines of the next pixel */
    double error;                                      /* of x and of y */
} sides;

/* The picture and its upper sides. A coordinate of a corner is off by the frame's error e, f by e (1 + |alpha1 s| + |beta1 t|)
 * and by rounding, u - u0 by e: and both are divided by at least the least u - u0. */
static void picture_of(const umb_ray_tilt *a, double u0, double z0, double sign, sides *p)
{
    const umb_ray_map *m = a->map;
    const umb_ray_shape *shape = a->shape;
    double size = 0.0, least = shape->u_min - u0;
    for (uint32_t i = 0; i < shape->point_count; ++i) {
        const umb_ray_point *c = &shape->points[i];
        double alpha = m->alpha0 + m->alpha1 * c->u, beta = m->beta0 + m->beta1 * c->u, r = 1.0 / (c->u - u0);
        p->corners[i] = (umb_ray_point){(c->v - alpha * a->s - beta * a->t) * r, sign * (c->z - z0) * r, 0.0};
        p->per_s[i] = alpha * r * m->ds;
        p->per_t[i] = beta * r * m->dt;
        double x = (fabs(c->v) + fabs(alpha * a->s) + fabs(beta * a->t)) * r;
        size = umb_most(size, x + fabs(p->corners[i].v) + UMB_TILE * (fabs(p->per_s[i]) + fabs(p->per_t[i])));
    }
    double shift = 1.0 + fabs(m->alpha1) * (fabs(a->s) + UMB_TILE * m->ds) + fabs(m->beta1) * (fabs(a->t) + UMB_TILE * m->dt);
    p->error = SLACK * size + 4.0 * m->frame->error * (1.0 + shift + size) / least;
    uint8_t order[UMB_RAY_OUTLINE];
    uint32_t n = umb_ray_hull(p->corners, shape->point_count, order);
    p->count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        const umb_ray_point *c = &p->corners[order[i]], *d = &p->corners[order[i + 1 < n ? i + 1 : 0]];
        double k = (d->v - c->v) / (d->u - c->u);
        if (d->u < c->u && fabs(k) < STEEPEST) {
            p->slopes[p->count++] = k;
        }
    }
}

/* Half of a pixel's lines, at u, as the picture shows it. */
static double half_width(const umb_ray_map *m, double u, double u0)
{
    return 0.5 * (fabs(m->alpha0 + m->alpha1 * u) * m->ds + fabs(m->beta0 + m->beta1 * u) * m->dt) / (u - u0);
}

/* Numbers become floats; the kernel rounds eight times what is not above size and more. Half a width is a convex function of
 * u over a positive one that is affine: it is largest at an end. */
static void lines_of(const umb_ray_tilt *a, const sides *p, double u0, umb_umbra_picture *out)
{
    double w = umb_most(half_width(a->map, a->u_min, u0), half_width(a->map, a->u_max, u0));
    out->slope_count = p->count;
    out->corner_count = a->shape->point_count;
    for (uint32_t k = 0; k < p->count; ++k) {
        double slope = p->slopes[k], size = 0.0;
        for (uint32_t i = 0; i < out->corner_count; ++i) {
            double ds = slope * p->per_s[i], dt = slope * p->per_t[i];
            double at = p->corners[i].v - slope * p->corners[i].u + 0.5 * (ds + dt);
            out->at[k][i] = (float)at;
            out->ds[k][i] = (float)ds;
            out->dt[k][i] = (float)dt;
            size = umb_most(size, fabs(at) + UMB_TILE * (fabs(ds) + fabs(dt)));
        }
        double more = fabs(slope) * w * (1.0 + SLACK) + (1.0 + fabs(slope)) * p->error;
        out->more[k] = (float)(more + 0x1p-20 * (more + size));
    }
}

bool umb_ray_tilt_bound(const umb_ray_tilt *a, const umb_umbra_kernels *kernels, umb_umbra_query *q)
{
    const umb_ray_frame *f = a->map->frame;
    const umb_ray_shape *shape = a->shape;
    if (shape->point_count == 0 || shape->point_count > UMB_UMBRA_CORNERS ||
        !(shape->u_min - a->ub > 0x1p-10 * f->hu + 16.0 * f->error)) {
        return false;
    }
    sides p;
    umb_umbra_picture picture;
    double u0 = shape->z1 >= f->z1 ? a->ua : a->ub; /* m is the lesser of both quotients */
    picture_of(a, u0, f->z1, 1.0, &p);
    lines_of(a, &p, u0, &picture);
    picture.limit = q->top;
    q->top = kernels->bound(&picture, q, 1.0f, q->tops);
    u0 = shape->z0 >= f->z0 ? a->ub : a->ua; /* M is the greater */
    picture_of(a, u0, f->z0, -1.0, &p);
    lines_of(a, &p, u0, &picture);
    picture.limit = -q->bottom;
    q->bottom = -kernels->bound(&picture, q, -1.0f, q->bottoms);
    q->tilted = true;
    return true;
}
