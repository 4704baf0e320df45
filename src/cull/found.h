/* The objects that a walk reports, and their order. */
#ifndef UMB_FOUND_H
#define UMB_FOUND_H

#include <stdbool.h>
#include <stdint.h>

typedef struct umb_found {
    float key; /* least W of the object's box */
    uint32_t id;
    bool inside; /* its box is wholly inside the frustum */
} umb_found;

/* By key, ties by id. Takes no memory; a list that is in order already costs one look at it. */
void umb_found_sort(umb_found *found, uint32_t count);

#endif
