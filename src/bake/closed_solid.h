/* Is a small mesh the border of a solid, seen from outside? */
#ifndef UMB_CLOSED_SOLID_H
#define UMB_CLOSED_SOLID_H

#include "scene/scene.h"

/* At most so many triangles are looked at in pairs. */
#define UMB_CLOSED_SOLID_MOST 512

/* True if the occluder's blocking triangles (world positions: those of its vertices) are closed, none two-sided, no two of
 * them pass through one another, and every connected part encloses a positive volume. Then the winding number is nowhere
 * negative, and whatever comes from outside its box and reaches a triangle from behind has come through a front
 * before. False where that is not proved. */
bool umb_closed_solid(const umb_occluder *o, const float (*positions)[3]);

#endif
