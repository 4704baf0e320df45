/* Objects that are nothing but their shape, asked about by the parts of it and then by single triangles: for methods
 * that are asked about hulls. */
#ifndef UMB_SHAPE_HULL_H
#define UMB_SHAPE_HULL_H

#include "hull.h"
#include "scene/scene.h"

typedef struct umb_shape_question {
    const umb_object *object;
    const umb_shadow_viewer *viewer;
    bool points_only; /* hulls come without polygons and faces */
    bool (*hidden)(const void *data, umb_hull *hull);
    bool (*open_at)(const void *data, const float p[3]); /* true: a point there is surely seen. May be NULL */
    const void *data;
    uint32_t *queries; /* counts what is asked */
} umb_shape_question;

/* True if all of the object is hidden. Its bounds have been asked about, and are not. */
bool umb_shape_hull_hidden(const umb_shape_question *q);

#endif
