/* A rival: the same z-buffer, fed by a tree. Nodes and objects come from a heap, nearest first; what the
 * z-buffer hides is not opened, and an occluder is drawn when its turn comes. The engine that keeps such a
 * tree does better than any flat pass in large worlds. */
#ifndef ZBUFFER_TREE_H
#define ZBUFFER_TREE_H

#include "zbuffer.h"

typedef struct zbuffer_tree zbuffer_tree;

zbuffer_tree *zbuffer_tree_create(const world *w, uint32_t width, uint32_t height);
void zbuffer_tree_destroy(zbuffer_tree *t);

/* A whole frame, as zbuffer_frame. */
uint32_t zbuffer_tree_frame(zbuffer_tree *t, const umb_view *view, const uint32_t **objects);

#endif
