#include "detail.h"

#include <string.h>

#include "geometry/transform.h"

bool umb_detail_hidden(const umb_asker *a, const umb_image *image, const umb_outline *outline)
{
    a->stats->queries += 1;
    return a->ops->hidden(a->method, image, outline);
}

umb_detail umb_detail_of(const umb_object *o)
{
    if (o->body && o->occluder != UMB_NONE) {
        return o->box ? UMB_DETAIL_NONE : UMB_DETAIL_BODY;
    }
    return o->refine && o->mesh->seen_count != 0 ? UMB_DETAIL_PARTS : UMB_DETAIL_NONE;
}

static void place_triangle(const umb_object *o, const uint32_t corner[3], float world[3][3])
{
    for (int k = 0; k < 3; ++k) {
        const float *p = o->mesh->positions[corner[k]];
        if (o->identity) {
            memcpy(world[k], p, sizeof world[k]);
        } else {
            umb_transform_point(&o->transform, p, world[k]);
        }
    }
}

/* True if the middle of a triangle is open to the eye: most visible things are found by this
 * alone. */
static bool middle_shows(const umb_asker *a, const float world[3][3], float *settled)
{
    const umb_raster_map *map = a->map;
    umb_view_point middle = {0.0, 0.0, 0.0, 0.0};
    double deepest = -INFINITY;
    for (int k = 0; k < 3; ++k) {
        umb_view_point v = umb_raster_map_point(map, world[k]);
        middle.x += v.x * (1.0 / 3.0);
        middle.y += v.y * (1.0 / 3.0);
        middle.w += v.w * (1.0 / 3.0);
        deepest = v.w > deepest ? v.w : deepest;
    }
    if (!(middle.w > map->least_w && middle.w < map->most_w)) {
        return false;
    }
    double r = map->orthographic ? 1.0 : 1.0 / middle.w;
    *settled = (float)(deepest < map->most_w ? deepest : map->most_w);
    return a->ops->open_at(a->method, middle.x * r + map->cx, middle.y * r + map->cy,
                           map->orthographic ? -middle.w : r);
}

static bool leaf_middle_shows(const umb_asker *a, const umb_object *o, const umb_part *part,
                              float *settled)
{
    for (uint32_t i = part->begin; i < part->end; ++i) {
        float world[3][3];
        place_triangle(o, o->mesh->triangles[o->mesh->part_order[i]], world);
        if (middle_shows(a, (const float(*)[3])world, settled)) {
            return true;
        }
    }
    return false;
}

static bool triangle_shows(const umb_asker *a, const float world[3][3],
                           const umb_face *face, float *settled)
{
    umb_image_bounds b;
    umb_outline outline;
    switch (umb_outline_of_triangle(a->map, world, face, &outline, &b)) {
    case UMB_DEPTH_OUTSIDE:
        return false;
    case UMB_DEPTH_CROSSING:
        *settled = -INFINITY;
        return true;
    default: {
        *settled = (float)b.w_max;
        umb_image image = umb_image_of_bounds(a->map, &b);
        return !umb_detail_hidden(a, &image, &outline);
    }
    }
}

/* Triangles that face the eye are asked first: one of them shows most visible things. */
static bool leaf_shows(const umb_asker *a, const umb_object *o, const umb_part *part,
                       float *settled)
{
    const umb_mesh *mesh = o->mesh;
    for (int away = 0; away < 2; ++away) {
        for (uint32_t i = part->begin; i < part->end; ++i) {
            float world[3][3];
            place_triangle(o, mesh->triangles[mesh->part_order[i]], world);
            umb_face face = umb_face_of(a->map, world[0], world[1], world[2]);
            if ((face.distance > 0.0) == (away == 0) &&
                triangle_shows(a, (const float(*)[3])world, &face, settled)) {
                return true;
            }
        }
    }
    return false;
}

/* A part in world coordinates is a box like those of nodes, and cheap to place; false if it is too close to the eye
 * for that. *image has no pixel if nothing of the part is in view. */
static bool place_part(const umb_asker *a, const umb_aabb *part, umb_image *image)
{
    umb_node node;
    umb_projected p;
    for (int axis = 0; axis < 3; ++axis) {
        for (int slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
            node.min[axis][slot] = part->min[axis];
            node.max[axis][slot] = part->max[axis];
        }
    }
    a->kernels->project(&node, a->projector, &p);
    bool away = p.beside != 0 || p.w_max[0] < a->map->least_w || p.w_min[0] > a->map->most_w;
    *image = (umb_image){{(int16_t)p.x0[0], (int16_t)p.y0[0], (int16_t)p.x1[0], (int16_t)p.y1[0]},
                         p.nearness[0]};
    if (away) {
        image->rect = (umb_pixel_rect){1, 1, 0, 0};
    }
    return p.testable != 0 || away;
}

static bool box_shows(const umb_asker *a, const umb_object *o, uint32_t part)
{
    if (part == 0 && o->identity) {
        return true; /* the object's bounds */
    }
    umb_image image;
    if (o->identity && place_part(a, &o->mesh->parts[part].box, &image)) {
        return !umb_detail_hidden(a, &image, NULL);
    }
    umb_image_bounds b;
    switch (umb_image_of_part(a->map, &o->mesh->parts[part].box, &o->transform, o->identity, &b)) {
    case UMB_DEPTH_OUTSIDE:
        return false;
    case UMB_DEPTH_CROSSING:
        return true;
    default:
        image = umb_image_of_bounds(a->map, &b);
        return !umb_detail_hidden(a, &image, NULL);
    }
}

bool umb_detail_shows(const umb_asker *a, const umb_object *o, uint32_t *part,
                      float *settled)
{
    const umb_mesh *mesh = o->mesh;
    while (*part < mesh->part_count) {
        const umb_part *p = &mesh->parts[*part];
        bool leaf = p->skip == *part + 1;
        if (leaf && leaf_middle_shows(a, o, p, settled)) {
            return true;
        }
        bool shows = box_shows(a, o, *part);
        if (shows && leaf) {
            shows = leaf_shows(a, o, p, settled);
            if (shows) {
                return true;
            }
        }
        *part = shows ? *part + 1 : p->skip;
    }
    return false;
}
