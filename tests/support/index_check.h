/* Is an index whole? Every item in it, every point of an item in one of its parts, boxes, links, lists and counts as they
 * should be. Fails as cmocka does. */
#ifndef INDEX_CHECK_H
#define INDEX_CHECK_H

#include "index/bvh.h"

void index_check(const umb_index *index);

static inline umb_aabb index_slot_box(const umb_node *n, uint32_t s)
{
    return (umb_aabb){{n->min[0][s], n->min[1][s], n->min[2][s]}, {n->max[0][s], n->max[1][s], n->max[2][s]}};
}

/* A corner of an object's or occluder's world triangle. */
void index_world_corner(const umb_mesh *mesh, const umb_transform *t, bool identity, uint32_t at, float out[3]);
/* A random point of a triangle of an item (objects, then occluders). False if only its box is known. */
bool index_point_of_item(const umb_committed *c, uint32_t item, uint64_t *seed, long double out[3]);

#endif
