/* Layers: objects and occluders are in some, each a bit of a mask; a view may be of some. */
#ifndef UMB_MASK_H
#define UMB_MASK_H

#include <stdbool.h>
#include <stdint.h>

/* What a view is of; bits 0: everything. */
typedef struct umb_mask {
    uint32_t bits;
    bool all; /* all of the bits are wanted, not one of them */
} umb_mask;

/* All layers that something with a mask is in, for unions of several. */
static inline uint32_t umb_layers_of(uint32_t mask)
{
    return mask != 0 ? mask : UINT32_MAX;
}

/* True if something in the layers of mask is in the view. */
static inline bool umb_mask_takes(umb_mask view, uint32_t mask)
{
    uint32_t common = mask & view.bits;
    return mask == 0 || (view.all ? common == view.bits : common != 0) || view.bits == 0;
}

#endif
