#include "found.h"

static bool before(const umb_found *a, const umb_found *b)
{
    return a->key != b->key ? a->key < b->key : a->id < b->id;
}

/* Let the entry at i sink in a heap whose root is the last in order. */
static void sink(umb_found *found, uint32_t count, uint32_t i)
{
    umb_found item = found[i];
    for (uint32_t child = 2 * i + 1; child < count; child = 2 * i + 1) {
        child += child + 1 < count && before(&found[child], &found[child + 1]);
        if (!before(&item, &found[child])) {
            break;
        }
        found[i] = found[child];
        i = child;
    }
    found[i] = item;
}

void umb_found_sort(umb_found *found, uint32_t count)
{
    bool ordered = true;
    for (uint32_t i = 1; i < count && ordered; ++i) {
        ordered = !before(&found[i], &found[i - 1]);
    }
    if (ordered) {
        return;
    }
    for (uint32_t i = count / 2; i-- > 0;) {
        sink(found, count, i);
    }
    for (uint32_t n = count; n-- > 1;) {
        umb_found last = found[n];
        found[n] = found[0];
        found[0] = last;
        sink(found, n, 0);
    }
}
