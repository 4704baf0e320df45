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
        out->depth = fmin(out->depth, depth - view->near_depth);
        double scale = view->projection == UMB_PERSPECTIVE ? depth : 1.0;
        for (int k = 0; k < 2; ++k) {
            double at = (d[0] * axes[k][0] + d[1] * axes[k][1] + d[2] * axes[k][2]) / scale;
            double size = k == 0 ? s->grid_width : s->grid_height;
            at = (at - ends[k][0]) / (ends[k][1] - ends[k][0]) * size;
            at = k == 0 ? at : size - at;
            out->low[k] = fmin(out->low[k], at);
            out->high[k] = fmax(out->high[k], at);
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

typedef struct rank {
    uint64_t key; /* nearness, then by lot */
    uint32_t object;
} rank;

static int by_key(const void *a, const void *b)
{
    const rank *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

void search_choose_nearest(search *s, uint32_t most)
{
    uint32_t count = s->target_count;
    if (count <= most) {
        return;
    }
    rank *ranks = malloc(count * sizeof(*ranks));
    if (!ranks) {
        s->failed = true;
        return;
    }
    uint32_t roomy = 0;
    for (uint32_t k = 0; k < count; ++k) {
        uint32_t object = s->targets[k];
        nearness near = nearness_of(s, object);
        roomy += near != NO_ROOM;
        ranks[k].key = (uint64_t)near << 62 | oracle_mix(object, s->round, 11) >> 2;
        ranks[k].object = object;
    }
    qsort(ranks, count, sizeof(*ranks), by_key);
    /* An eighth of the choice is from those without room, whatever there is of the others. */
    uint32_t first = roomy < most - most / 8 ? roomy : most - most / 8;
    for (uint32_t k = 0; k < most; ++k) {
        uint32_t from = k < first ? k : roomy + k - first;
        s->targets[k] = ranks[from < count ? from : k].object;
    }
    s->target_count = most;
    free(ranks);
}
