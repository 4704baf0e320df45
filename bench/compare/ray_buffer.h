/* A rival: the ray-cast occlusion buffer, as an open game engine has it. One ray a pixel of a small
 * picture through a tracer's tree of the occluders, farthest depths halved again and again, and boxes
 * tested by rectangle from the coarsest level that shows them down, over at most 512 texels. What is
 * compared is the engine's: the straight distance of the box against view depth. */
#ifndef RAY_BUFFER_H
#define RAY_BUFFER_H

#include "screen_boxes.h"

typedef struct ray_buffer ray_buffer;

ray_buffer *ray_buffer_create(const world *w, uint32_t width, uint32_t height);
void ray_buffer_destroy(ray_buffer *r);

/* A whole frame: frustum, rays, levels, every box. The tree stands already. */
uint32_t ray_buffer_frame(ray_buffer *r, const umb_view *view, const uint32_t **objects);

/* Milliseconds to build the tree again, as any moved occluder makes it: the tracer's default quality,
 * or its quickest. One thread. */
double ray_buffer_rebuild(ray_buffer *r, bool quickest);

#endif
