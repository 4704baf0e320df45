/* Asking a method about an object in detail: by the parts of its shape, then by single
 * triangles. */
#ifndef UMB_DETAIL_H
#define UMB_DETAIL_H

#include "occlusion/image.h"
#include "occlusion/method.h"

/* Whom to ask, and where the questions are counted. */
typedef struct umb_asker {
    const umb_method_ops *ops;
    const void *method;
    const umb_box_kernels *kernels;
    const umb_projector *projector; /* the map's */
    const umb_raster_map *map;
    umb_cull_stats *stats;
} umb_asker;

/* In what detail it is worth asking about an object. */
typedef enum umb_detail {
    UMB_DETAIL_NONE, /* its bounds say all that is known */
    UMB_DETAIL_BODY, /* it is one convex body, the one that its occluder is */
    UMB_DETAIL_PARTS /* by its parts, then by triangles */
} umb_detail;

umb_detail umb_detail_of(const umb_object *o);

/* One question: all of an image, or the outline in it. */
bool umb_detail_hidden(const umb_asker *a, const umb_image *image, const umb_outline *outline);

/* Walk the parts of an object that is its shape, from *part on to the first that may be seen, and
 * stay there: parts passed over are hidden and remain so. False if all are. *settled becomes the
 * greatest W, in view, of what may be seen: nothing drawn beyond it can hide that. The
 * object's bounds have been asked about before. */
bool umb_detail_shows(const umb_asker *a, const umb_object *o, uint32_t *part, float *settled);

#endif
