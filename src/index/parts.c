#include "parts.h"

/* The link that leads to a place of an object. */
static uint32_t *link_to(uint32_t *places, uint32_t *next, uint32_t object, uint32_t place)
{
    uint32_t *link = &places[object];
    while (*link != place) {
        link = &next[*link];
    }
    return link;
}

/* The last slot of a node takes the place of another one. Returns *link's new home, if that was moved. */
static uint32_t *fill_gap(umb_node *nodes, uint32_t *places, uint32_t *next, uint32_t gap, uint32_t *link)
{
    umb_node *node = &nodes[gap / UMB_NODE_WIDTH];
    uint32_t to = gap % UMB_NODE_WIDTH, last = --node->count, ref = node->ref[last], from = gap - to + last;
    if (last == to) {
        return link;
    }
    for (int i = 0; i < 3; ++i) {
        node->min[i][to] = node->min[i][last];
        node->max[i][to] = node->max[i][last];
    }
    node->ref[to] = ref;
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        nodes[ref].slot = to;
    } else if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT) {
        *link_to(places, next, ref & UMB_REF_NUMBER, from) = gap;
        next[gap] = next[from];
        return link == &next[from] ? &next[gap] : link;
    }
    return link;
}

static void take_box(umb_node *nodes, uint32_t place, const umb_aabb *box)
{
    umb_node *node = &nodes[place / UMB_NODE_WIDTH];
    for (int i = 0; i < 3; ++i) {
        node->min[i][place % UMB_NODE_WIDTH] = box->min[i];
        node->max[i][place % UMB_NODE_WIDTH] = box->max[i];
    }
}

void umb_parts_gather_moved(umb_node *nodes, uint32_t *places, uint32_t *next, const umb_bvh_marks *marks,
                            const umb_committed *scene)
{
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        uint32_t object = scene->moved[i];
        if (places[object] == UMB_NONE) {
            continue;
        }
        uint32_t *link = &next[places[object]];
        while (*link != UMB_NONE) {
            uint32_t place = *link, number = place / UMB_NODE_WIDTH;
            umb_bvh_mark(marks, number);
            if (nodes[number].count == 1) {
                take_box(nodes, place, &scene->objects[object].bounds);
                link = &next[place];
            } else {
                *link = next[place];
                link = fill_gap(nodes, places, next, place, link);
            }
        }
    }
}
