/* Convex bodies inside solids that are not convex. */
#ifndef UMB_SOLID_INNER_H
#define UMB_SOLID_INNER_H

#include "solid.h"

/* Add, for each flat convex face of an occluder whose surface is closed, what the surface goes round of what lies behind it, as
 * deep as nothing else of the surface comes in: the wings of a building. Bodies overlap where wings meet; one that another
 * holds is left out. */
umb_result umb_solids_add_inner(umb_solids *s, const umb_occluder *o, uint32_t number);

#endif
