/* Which hidden objects are nearest to being seen: where the grid's rays went on beyond an object's
 * box, in the cells of its image or right beside them.
 *
 * Only a choice of where to aim: it decides nothing, so plain doubles and a coarse look do. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

/* Cells of an image that are looked at, each way; larger images are sampled. */
#define LOOKS 12u

typedef enum nearness {
    ROOM_WITHIN = 0, /* the grid saw farther than the box somewhere in its image */
    ROOM_BESIDE = 1, /* the same one cell beside it */
    NO_ROOM = 2
} nearness;

/* The image of a box, in grid cells, and the depth beyond near where it begins. */
typedef struct image {
    double low[2], high[2], depth;
} image;

/* Without the care for NaN that keeps fmin from being one instruction. */
static double least(double a, double b)
{
    return b < a ? b : a;
}

static bool project(const search *s, const umb_aabb *box, image *out)
{
    const umb_view *view = s->view.view;
    const double *axes[2] = {view->right, view->up};
    double ends[2][2] = {{view->x_min, view->x_max}, {view->y_min, view->y_max}};
    *out = (image){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, INFINITY};
    for (int corner = 0; corner < 8; ++corner) {
        double d[3], depth = 0.0;
        for (int i = 0; i < 3; ++i) {
            d[i] = (corner >> i & 1 ? box->max[i] : box->min[i]) - view->eye[i];
            depth += d[i] * view->forward[i];
        }
        out->depth = least(out->depth, depth - view->near_depth);
        double scale = view->projection == UMB_PERSPECTIVE ? depth : 1.0;
        for (int k = 0; k < 2; ++k) {
            double at = (d[0] * axes[k][0] + d[1] * axes[k][1] + d[2] * axes[k][2]) / scale;
            double size = k == 0 ? s->grid_width : s->grid_height;
            at = (at - ends[k][0]) / (ends[k][1] - ends[k][0]) * size;
            at = k == 0 ? at : size - at;
            out->low[k] = least(out->low[k], at);
            out->high[k] = -least(-out->high[k], -at);
        }
    }
    /* A box that reaches behind the near plane: anywhere in the picture. */
    return view->projection == UMB_ORTHOGRAPHIC || out->depth > 0.0;
}

static bool room(const search *s, const image *m, double beside)
{
    uint32_t first[2], last[2];
    for (int k = 0; k < 2; ++k) {
        double end = (k == 0 ? s->grid_width : s->grid_height) - 1.0;
        first[k] = (uint32_t)fmin(fmax(floor(m->low[k] - beside), 0.0), end);
        last[k] = (uint32_t)fmin(fmax(floor(m->high[k] + beside), 0.0), end);
    }
    uint32_t step[2] = {1 + (last[0] - first[0]) / LOOKS, 1 + (last[1] - first[1]) / LOOKS};
    for (uint32_t y = first[1]; y <= last[1]; y += step[1]) {
        for (uint32_t x = first[0]; x <= last[0]; x += step[0]) {
            if (s->grid_depth[(size_t)y * s->grid_width + x] > m->depth) {
                return true;
            }
        }
    }
    return false;
}

static nearness nearness_of(const search *s, uint32_t object)
{
    image m;
    if (!project(s, &s->t->model->objects[object].bounds, &m)) {
        return ROOM_WITHIN;
    }
    return room(s, &m, 0.0) ? ROOM_WITHIN : room(s, &m, 1.0) ? ROOM_BESIDE : NO_ROOM;
}

/* The grid is cast once, so what it says of an object stays. */
static nearness remembered(search *s, uint32_t object)
{
    if (s->near[object] == 0) {
        s->near[object] = (uint8_t)(nearness_of(s, object) + 1);
    }
    return (nearness)(s->near[object] - 1);
}

typedef struct rank {
    uint64_t key; /* nearness, then by lot */
    uint32_t object;
} rank;

static int by_key(const void *a, const void *b)
{
    const rank *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

/* The ranks of least key among those added: twice as many as are wanted are kept before they are sorted and cut. */
typedef struct shortlist {
    rank *ranks;
    uint32_t count, most;
    uint64_t limit; /* greater keys are no use */
} shortlist;

static void shorten(shortlist *l)
{
    qsort(l->ranks, l->count, sizeof(*l->ranks), by_key);
    if (l->count >= l->most) {
        l->count = l->most;
        l->limit = l->ranks[l->most - 1].key;
    }
}

static void add(shortlist *l, rank r)
{
    if (r.key > l->limit) {
        return;
    }
    l->ranks[l->count++] = r;
    if (l->count == 2 * l->most) {
        shorten(l);
    }
}

void search_choose_nearest(search *s, uint32_t most)
{
    uint32_t count = s->target_count;
    if (count <= most) {
        return;
    }
    rank *ranks = malloc(4 * (size_t)most * sizeof(*ranks));
    if (!ranks) {
        s->failed = true;
        return;
    }
    shortlist roomy = {ranks, 0, most, UINT64_MAX}, others = {ranks + 2 * (size_t)most, 0, most, UINT64_MAX};
    for (uint32_t k = 0; k < count; ++k) {
        uint32_t object = s->targets[k];
        nearness near = remembered(s, object);
        rank r = {(uint64_t)near << 62 | oracle_mix(object, s->round, 11) >> 2, object};
        add(near != NO_ROOM ? &roomy : &others, r);
    }
    shorten(&roomy);
    shorten(&others);
    /* An eighth of the choice is from those without room, whatever there is of the others. */
    uint32_t first = roomy.count < most - most / 8 ? roomy.count : most - most / 8;
    for (uint32_t k = 0; k < most; ++k) {
        bool other = k >= first && k - first < others.count;
        s->targets[k] = other ? others.ranks[k - first].object : roomy.ranks[k].object;
    }
    s->target_count = most;
    free(ranks);
}
