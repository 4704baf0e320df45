/* From what selection picks to shadows: the triangles of a pick that face the viewer, placed in the world, and the
 * edges around them. */
#ifndef UMB_FRONTS_H
#define UMB_FRONTS_H

#include "select.h"
#include "shadows.h"

/* Fronts of more triangles are not made. */
enum { UMB_FRONT_TRIANGLES = 128 };

/* Room for one front; 15 KiB. */
typedef struct umb_front_room {
    float points[3 * UMB_FRONT_TRIANGLES + 2 * UMB_SHADOW_LINES][3];
    uint32_t triangles[UMB_FRONT_TRIANGLES][3];
    uint32_t edges[UMB_SHADOW_LINES][2];
    uint32_t corners[UMB_SHADOW_LINES][2]; /* beside the edges: their vertices in the mesh */
    uint32_t triangle_count, edge_count;
} umb_front_room;

/* Add the shadow of a pick: of a facet, of all of a body that faces the viewer, or, where the near plane cuts a body, of
 * each of its facets. Their source becomes the occluder's number. Returns how many shadows were added. */
uint32_t umb_fronts_add(umb_shadows *shadows, umb_front_room *room, const umb_pick *pick);

#endif
