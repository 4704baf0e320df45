#include "once.h"

#include <math.h>
#include <string.h>

#include "found.h"

#define LAST_FRAME (UINT32_MAX >> UMB_ONCE_BITS)

static void forget(umb_once *o)
{
    if (o->object_capacity > 0) {
        memset(o->objects, 0, o->object_capacity * sizeof *o->objects);
    }
    if (o->occluder_capacity > 0) {
        memset(o->occluders, 0, o->occluder_capacity * sizeof *o->occluders);
    }
    o->frame = 0;
}

bool umb_once_begin(umb_once *o, const umb_allocator *a, const umb_committed *scene)
{
    size_t objects = o->object_capacity, occluders = o->occluder_capacity;
    if (!umb_memory_reserve(a, (void **)&o->objects, &o->object_capacity, scene->object_count, sizeof *o->objects) ||
        !umb_memory_reserve(a, (void **)&o->occluders, &o->occluder_capacity, scene->occluder_count,
                            sizeof *o->occluders)) {
        return false;
    }
    if (o->object_capacity > objects || o->occluder_capacity > occluders || o->frame == LAST_FRAME) {
        forget(o);
    }
    ++o->frame;
    return true;
}

void umb_once_free(umb_once *o, const umb_allocator *a)
{
    umb_memory_free(a, o->objects, o->object_capacity * sizeof *o->objects);
    umb_memory_free(a, o->occluders, o->occluder_capacity * sizeof *o->occluders);
    *o = (umb_once){0};
}

/* Eight boxes that are no object's place: a bit for each whose object is in view wherever it is, for nobody knows, and for
 * each that does not even hold it any more. */
typedef struct lost_boxes {
    uint32_t all, empty;
} lost_boxes;

/* Eight whole boxes as a node: where the objects are, or their volumes. */
static lost_boxes gather(const umb_once_view *v, const uint32_t *ids, uint32_t count, umb_node *out)
{
    lost_boxes lost = {0, 0};
    out->count = count;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        const umb_object *o = &v->scene->objects[ids[slot < count ? slot : 0]];
        bool roams = v->movers != NULL && umb_movers_roams(v->movers, o);
        const umb_posed *p = roams ? umb_movers_find(v->movers, o->mover) : NULL;
        const umb_aabb *box = p != NULL && p->known ? &p->bounds : &o->bounds;
        lost.all |= p != NULL && !p->known ? 1u << slot : 0;
        lost.empty |= p != NULL && !p->known && p->expired ? 1u << slot : 0;
        for (int i = 0; i < 3; ++i) {
            out->min[i][slot] = box->min[i];
            out->max[i][slot] = box->max[i];
        }
    }
    return lost;
}

uint32_t umb_once_finish(const umb_once_view *v, const uint32_t *ids, uint32_t count, uint64_t *entries,
                         uint32_t *objects, uint8_t *inside)
{
    uint32_t written = 0;
    for (uint32_t i = 0; i < count; i += UMB_NODE_WIDTH) {
        uint32_t n = count - i < UMB_NODE_WIDTH ? count - i : UMB_NODE_WIDTH, batch[UMB_NODE_WIDTH];
        umb_node node;
        umb_projected projected;
        uint16_t left[UMB_NODE_WIDTH];
        memcpy(batch, ids + i, n * sizeof batch[0]);
        lost_boxes lost = gather(v, batch, n, &node);
        uint32_t in = lost.all;
        in |= ~umb_frustum_test_node(v->frustum, v->kernels, &node, v->frustum->all_planes, NULL, left);
        in &= (1u << n) - 1u;
        if (entries != NULL) {
            v->kernels->project(&node, v->projector, &projected);
        }
        for (; in != 0; in &= in - 1) {
            uint32_t slot = (uint32_t)__builtin_ctz(in);
            bool empty = (lost.empty >> slot & 1u) != 0, whole = left[slot] == 0 && !empty;
            if (entries != NULL) {
                float key = empty ? -INFINITY : projected.w_min[slot];
                entries[written++] = umb_found_entry(key, batch[slot], whole);
            } else {
                objects[written] = batch[slot];
                inside[written++] = whole;
            }
        }
    }
    return written;
}
