#include "tree_stock.h"

#include <string.h>

void umb_tree_stock_free(umb_tree_stock *s, const umb_allocator *a)
{
    umb_memory_free(a, s->nodes, s->node_capacity * sizeof *s->nodes);
    umb_memory_free(a, s->below, s->below_capacity * sizeof *s->below);
    umb_memory_free(a, s->places, s->place_capacity * sizeof *s->places);
    umb_memory_free(a, s->occluder_places, s->occluder_capacity * sizeof *s->occluder_places);
    umb_bvh_marks_free(&s->marks, a);
    *s = (umb_tree_stock){0};
}

size_t umb_tree_stock_memory(const umb_tree_stock *s)
{
    return s->node_capacity * sizeof *s->nodes + s->below_capacity * sizeof *s->below +
           (s->place_capacity + s->occluder_capacity) * sizeof(uint32_t) + umb_bvh_marks_memory(&s->marks);
}

static void forget(uint32_t *places, size_t count)
{
    if (count > 0) {
        memset(places, 0xFF, count * sizeof *places);
    }
}

void umb_tree_stock_forget_places(umb_tree_stock *s)
{
    forget(s->places, s->place_capacity);
    forget(s->occluder_places, s->occluder_capacity);
}

void umb_tree_stock_forget(umb_tree_stock *s)
{
    umb_tree_stock_forget_places(s);
    umb_bvh_marks_clear(&s->marks);
}
