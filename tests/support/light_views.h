/* Views that a camera rarely has and lights do, over a micro scene: parallel ones that begin
 * behind their eye, rectangles beside the axis, extra planes at random and through the
 * geometry, spots, cube faces, cascades of a sun, volumes. */
#ifndef LIGHT_VIEWS_H
#define LIGHT_VIEWS_H

#include "micro_scenes.h"

uint32_t light_view_kinds(void);
const char *light_view_name(uint32_t kind);
/* Make a view of a kind from a seed. False when the seed has none of this kind. */
bool light_view_make(uint32_t kind, uint64_t seed, const micro_scene *micro, umb_view *out);

#endif
