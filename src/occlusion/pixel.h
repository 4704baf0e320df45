/* From raster coordinates to pixels. */
#ifndef UMB_PIXEL_H
#define UMB_PIXEL_H

#include <stdint.h>

/* Rasters are at most 8192 wide and high; pixel coordinates are cut to somewhat more on both
 * sides. */
#define UMB_PIXEL_FAR 16384.0

/* Largest whole number not above v, or the next one when v is within 2^-37 below that: a conversion
 * in place of a call of floor. v is cut first; NaN does not occur. */
static inline int32_t umb_pixel_floor(double v)
{
    v = v > -UMB_PIXEL_FAR ? v : -UMB_PIXEL_FAR;
    v = v < UMB_PIXEL_FAR ? v : UMB_PIXEL_FAR;
    return (int32_t)(v + UMB_PIXEL_FAR) - (int32_t)UMB_PIXEL_FAR;
}

/* What callers widen by so that the above never costs them a pixel. */
#define UMB_PIXEL_SLACK 0x1p-30

#endif
