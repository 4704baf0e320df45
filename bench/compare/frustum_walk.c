/* Kernels over rows of eight boxes. */
#include "frustum_walk.h"

#include <stdlib.h>

#include "frustum/box_kernels.h"

typedef struct waiting_node {
    uint32_t node;
    uint16_t planes;
} waiting_node;

struct frustum_walk {
    const umb_index *index;
    const umb_box_kernels *kernels;
    uint32_t *inside;
    waiting_node *stack;
};

frustum_walk *frustum_walk_create(const umb_index *index, uint32_t object_count)
{
    frustum_walk *f = calloc(1, sizeof *f);
    if (f == NULL) {
        return NULL;
    }
    f->index = index;
    f->kernels = umb_box_kernels_get(UMB_ISA_AUTO);
    f->inside = malloc(((size_t)object_count + UMB_NODE_WIDTH) * sizeof *f->inside);
    f->stack = malloc(((size_t)umb_index_tree(index)->node_count + 1) * sizeof *f->stack);
    if (f->inside == NULL || f->stack == NULL || f->kernels == NULL) {
        frustum_walk_destroy(f);
        return NULL;
    }
    return f;
}

void frustum_walk_destroy(frustum_walk *f)
{
    if (f != NULL) {
        free(f->inside);
        free(f->stack);
        free(f);
    }
}

static uint32_t walk_rows(frustum_walk *f, const umb_frustum *frustum, const umb_tree *tree)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < tree->node_count; ++i) {
        const umb_node *n = &tree->nodes[i];
        uint16_t left[UMB_NODE_WIDTH];
        uint32_t outside = umb_frustum_test_node(frustum, f->kernels, n, frustum->all_planes, NULL,
                                                 left);
        for (uint32_t in = ~outside & 0xFFu; in != 0; in &= in - 1) {
            uint32_t ref = n->ref[__builtin_ctz(in)];
            f->inside[count] = ref & UMB_REF_NUMBER;
            count += (ref & UMB_REF_KIND) == UMB_REF_OBJECT;
        }
    }
    return count;
}

static uint32_t walk_tree(frustum_walk *f, const umb_frustum *frustum, const umb_tree *tree)
{
    uint32_t count = 0;
    uint32_t waiting = 0;
    if (tree->node_count != 0) {
        f->stack[waiting++] = (waiting_node){0, frustum->all_planes};
    }
    while (waiting != 0) {
        waiting_node w = f->stack[--waiting];
        const umb_node *n = &tree->nodes[w.node];
        uint16_t left[UMB_NODE_WIDTH] = {0};
        uint32_t in = (1u << n->count) - 1u;
        if (w.planes != 0) {
            in &= ~umb_frustum_test_node(frustum, f->kernels, n, w.planes, NULL, left);
        }
        for (; in != 0; in &= in - 1) {
            uint32_t slot = (uint32_t)__builtin_ctz(in);
            uint32_t ref = n->ref[slot];
            if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
                f->stack[waiting++] = (waiting_node){ref & UMB_REF_NUMBER, left[slot]};
            } else if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT) {
                f->inside[count++] = ref & UMB_REF_NUMBER;
            }
        }
    }
    return count;
}

uint32_t frustum_walk_frame(frustum_walk *f, const umb_view *view, const uint32_t **objects)
{
    const umb_tree *tree = umb_index_tree(f->index);
    umb_frustum frustum;
    umb_frustum_prepare(&frustum, view);
    *objects = f->inside;
    return tree->flat ? walk_rows(f, &frustum, tree) : walk_tree(f, &frustum, tree);
}
