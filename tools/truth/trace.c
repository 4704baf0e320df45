/* One sight-line through the scene: the first blocking surface for either renderer and the open
 * surfaces before it.
 *
 * A front face met first settles both renderers with one ray. Only where a one-sided face is met
 * from its back does the renderer that culls back faces need a second ray.
 */
#include <math.h>
#include <stdlib.h>

#include "oracle.h"

typedef struct trace_context {
    struct RTCIntersectContext base; /* first: the filter gets a pointer to it */
    const truth *t;
    oracle_trace *trace;
    bool culling;
} trace_context;

static void locate(const truth *t, uint32_t part, uint32_t primitive, uint32_t instance,
                   oracle_hit *out)
{
    if (t->flat) {
        out->object = t->parts[part].objects[primitive];
        out->triangle = t->parts[part].triangles[primitive];
    } else {
        out->object = instance;
        out->triangle = t->mesh_parts[t->model->objects[instance].mesh][part].triangles[primitive];
    }
}

static void collect_open(trace_context *c, uint32_t primitive, uint32_t instance, float depth)
{
    oracle_trace *trace = c->trace;
    if (trace->open_count == trace->open_capacity) {
        uint32_t capacity = trace->open_capacity ? 2 * trace->open_capacity : 64;
        oracle_hit *more = realloc(trace->open, capacity * sizeof(*more));
        if (!more) {
            trace->out_of_memory = true;
            return;
        }
        trace->open = more;
        trace->open_capacity = capacity;
    }
    oracle_hit *hit = &trace->open[trace->open_count++];
    locate(c->t, PART_OPEN, primitive, instance, hit);
    hit->depth = depth;
}

/* Rays are traced one at a time, so the packets that a filter sees are plain structs. */
static void filter(const struct RTCFilterFunctionNArguments *args)
{
    trace_context *c = (trace_context *)(void *)args->context;
    const struct RTCRay *ray = (const struct RTCRay *)(const void *)args->ray;
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)args->hit;
    if (args->valid[0] != -1) {
        return;
    }
    if (hit->geomID == PART_OPEN) {
        collect_open(c, hit->primID, hit->instID[0], ray->tfar);
        args->valid[0] = 0;
    } else if (hit->geomID == PART_ONE_SIDE && c->culling) {
        /* Normal and direction are both in the space of the instance, where corners run
         * counter-clockwise seen from the front whatever the transform does. */
        double facing = (double)hit->Ng_x * ray->dir_x + (double)hit->Ng_y * ray->dir_y +
                        (double)hit->Ng_z * ray->dir_z;
        if (facing > 0.0) {
            args->valid[0] = 0;
        }
    }
}

static void cast_ray(const truth *t, const oracle_sight *sight, float start, float end,
                     trace_context *c, oracle_hit *hit)
{
    struct RTCRayHit q;
    q.ray.org_x = (float)sight->from[0];
    q.ray.org_y = (float)sight->from[1];
    q.ray.org_z = (float)sight->from[2];
    q.ray.dir_x = (float)sight->along[0];
    q.ray.dir_y = (float)sight->along[1];
    q.ray.dir_z = (float)sight->along[2];
    q.ray.tnear = start;
    q.ray.tfar = end;
    q.ray.time = 0.0f;
    q.ray.mask = 0xFFFFFFFFu;
    q.ray.id = 0;
    q.ray.flags = 0;
    q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcInitIntersectContext(&c->base);
    c->base.filter = c->culling || t->has_open ? filter : NULL;
    c->trace->open_count = 0;
    rtcIntersect1(t->scene, &c->base, &q);
    hit->object = MODEL_NONE;
    hit->triangle = 0;
    hit->facing = 0;
    hit->depth = end;
    if (q.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
        locate(t, q.hit.geomID, q.hit.primID, q.hit.instID[0], hit);
        hit->depth = q.ray.tfar;
    }
    ++c->trace->rays;
}

int oracle_facing_along(float v[3][3], const double along[3])
{
    double e[3], f[3], sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        e[i] = (double)v[1][i] - v[0][i];
        f[i] = (double)v[2][i] - v[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        sum += (e[j] * f[k] - e[k] * f[j]) * along[i];
    }
    return sum < 0.0 ? -1 : sum > 0.0;
}

int oracle_facing(float v[3][3], const double eye[3])
{
    double along[3] = {v[0][0] - eye[0], v[0][1] - eye[1], v[0][2] - eye[2]};
    return oracle_facing_along(v, along);
}

double oracle_plane_depth(float v[3][3], const oracle_sight *sight, double fallback, int *facing)
{
    double e[3], f[3], numerator = 0.0, denominator = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        e[i] = (double)v[1][i] - v[0][i];
        f[i] = (double)v[2][i] - v[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double n = e[j] * f[k] - e[k] * f[j];
        numerator += n * (v[0][i] - sight->from[i]);
        denominator += n * sight->along[i];
        size += fabs(n * sight->along[i]);
    }
    if (fabs(denominator) <= 1e-12 * size) {
        *facing = 0;
        return fallback;
    }
    *facing = denominator < 0.0 ? -1 : 1;
    return numerator / denominator;
}

bool oracle_shown(uint8_t flags, int facing)
{
    return facing <= 0 || (flags & UMB_TRIANGLE_TWO_SIDED) != 0;
}

static void refine(const truth *t, const oracle_sight *sight, oracle_hit *hit)
{
    float v[3][3];
    oracle_triangle(t, hit->object, hit->triangle, v);
    double depth = oracle_plane_depth(v, sight, hit->depth, &hit->facing);
    /* A nearly edge-on plane says little: believe it only near what the ray said. */
    if (fabs(depth - hit->depth) <= 1e-3 * (1.0 + fabs(hit->depth))) {
        hit->depth = depth;
    }
}

/* First hit that is not nearer than the near plane. */
static void first(const truth *t, const oracle_sight *sight, float end, trace_context *c,
                  oracle_hit *hit)
{
    float start = 0.0f;
    for (int tries = 0; tries < 8; ++tries) {
        cast_ray(t, sight, start, end, c, hit);
        if (hit->object == MODEL_NONE) {
            return;
        }
        float reached = (float)hit->depth;
        refine(t, sight, hit);
        if (hit->depth >= 0.0) {
            return;
        }
        start = nextafterf(reached, INFINITY);
    }
}

void oracle_trace_ray(const truth *t, const oracle_view *v, const oracle_sight *sight,
                      oracle_trace *trace)
{
    trace_context c = {.t = t, .trace = trace};
    float end = (float)(v->far_depth - v->view->near_depth);
    if (!(end > 0.0f)) {
        trace->open_count = 0;
        trace->two_sided.object = trace->culling.object = MODEL_NONE;
        trace->two_sided.depth = trace->culling.depth = 0.0;
        return;
    }
    first(t, sight, end, &c, &trace->two_sided);
    trace->culling = trace->two_sided;
    if (trace->two_sided.object != MODEL_NONE && trace->two_sided.facing > 0 &&
        !oracle_shown(oracle_flags(t, trace->two_sided.object, trace->two_sided.triangle), 1)) {
        c.culling = true;
        first(t, sight, end, &c, &trace->culling);
    }
    for (uint32_t i = 0; i < trace->open_count; ++i) {
        refine(t, sight, &trace->open[i]);
    }
}
