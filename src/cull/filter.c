#include "filter.h"

#include <string.h>

#include "found.h"
#include "index/tree.h"

bool umb_filter_restrict(umb_filter *f, const umb_allocator *a, const uint32_t *bits, uint32_t object_count)
{
    size_t words = ((size_t)object_count + 31) / 32;
    if (bits != NULL && !umb_memory_reserve(a, (void **)&f->candidates, &f->capacity, words, sizeof *f->candidates)) {
        return false;
    }
    if (bits != NULL && words > 0) {
        memcpy(f->candidates, bits, words * sizeof *bits);
    }
    f->restricted = bits != NULL;
    f->candidate_count = bits != NULL ? object_count : 0;
    return true;
}

void umb_filter_free(umb_filter *f, const umb_allocator *a)
{
    umb_memory_free(a, f->candidates, f->capacity * sizeof *f->candidates);
    *f = (umb_filter){0};
}

const umb_filter *umb_filter_begin(umb_filter *f, const umb_view *view, const umb_committed *scene, const umb_tree *tree)
{
    f->scene = scene;
    f->tree = tree;
    f->mask = (umb_mask){view->mask, view->mask_all};
    f->hides = view->masked_hide;
    return view->mask != 0 && !view->masked_hide ? f : NULL;
}

uint32_t umb_filter_present(const umb_filter *f, const umb_node *node, uint32_t slots, umb_cull_stats *stats)
{
    uint32_t present = slots;
    for (uint32_t left = slots; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left), number = node->ref[slot] & UMB_REF_NUMBER;
        switch (node->ref[slot] & UMB_REF_KIND) {
        case UMB_REF_OBJECT:
            if (!umb_filter_has(f, number)) {
                present &= ~(1u << slot);
                stats->left_out += 1;
            }
            break;
        case UMB_REF_OCCLUDER:
            present &= umb_mask_takes(f->mask, f->scene->occluder_masks[number]) ? ~0u : ~(1u << slot);
            break;
        default: /* a node */
            present &= umb_mask_takes(f->mask, umb_tree_node(f->tree, number)->layers) ? ~0u : ~(1u << slot);
            break;
        }
    }
    return present;
}

static bool reports(const umb_filter *f, uint32_t object)
{
    bool candidate = !f->restricted ||
                     (object < f->candidate_count && (f->candidates[object / 32] >> object % 32 & 1u) != 0);
    return candidate && umb_filter_has(f, object);
}

uint32_t umb_filter_entries(const umb_filter *f, uint64_t *entries, uint32_t count)
{
    uint32_t left = 0;
    for (uint32_t i = 0; i < count; ++i) {
        entries[left] = entries[i];
        left += reports(f, umb_found_id(entries[i]));
    }
    return left;
}

uint32_t umb_filter_ids(const umb_filter *f, uint32_t *objects, uint8_t *inside, uint32_t count)
{
    uint32_t left = 0;
    for (uint32_t i = 0; i < count; ++i) {
        objects[left] = objects[i];
        inside[left] = inside[i];
        left += reports(f, objects[i]);
    }
    return left;
}
