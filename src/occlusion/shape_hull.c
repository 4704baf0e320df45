#include "shape_hull.h"

#include <string.h>

#include "geometry/transform.h"

/* What is nearer than the near depth is not seen. */
static bool is_near(const umb_shape_question *q, const float (*points)[3], uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        double off, w = umb_shadow_depth(q->viewer, points[i], &off);
        if (!(w + off < q->viewer->near_depth)) {
            return false;
        }
    }
    return true;
}

static bool ask(const umb_shape_question *q, umb_hull *hull)
{
    *q->queries += 1;
    return q->hidden(q->data, hull);
}

static bool is_seen(const umb_shape_question *q, const float p[3])
{
    if (q->open_at == NULL) {
        return false;
    }
    double off, w = umb_shadow_depth(q->viewer, p, &off);
    return w > q->viewer->near_depth && q->open_at(q->data, p);
}

/* A box whose middle is seen is not hidden: that is quicker to find than the whole of it. */
static bool middle_shows(const umb_shape_question *q, const umb_aabb *box)
{
    const umb_object *o = q->object;
    float middle[3], world[3];
    for (int k = 0; k < 3; ++k) {
        middle[k] = (float)(0.5 * ((double)box->min[k] + box->max[k]));
        world[k] = middle[k];
    }
    if (!o->identity) {
        umb_transform_point(&o->transform, middle, world);
    }
    return is_seen(q, world);
}

static bool box_hidden(const umb_shape_question *q, uint32_t part)
{
    const umb_object *o = q->object;
    const umb_aabb *box = &o->mesh->parts[part].box;
    umb_hull hull;
    bool ready;
    if (o->identity && part == 0) {
        return false; /* the object's bounds */
    }
    if (middle_shows(q, box)) {
        return false;
    }
    if (o->identity) {
        ready = q->points_only ? umb_hull_points_of_box(&hull, q->viewer, box) : umb_hull_of_box(&hull, q->viewer, box);
    } else {
        ready = q->points_only ? umb_hull_points_of_turned_box(&hull, q->viewer, box, &o->transform)
                               : umb_hull_of_turned_box(&hull, q->viewer, box, &o->transform);
    }
    return ready && ask(q, &hull);
}

static void place_triangle(const umb_object *o, uint32_t triangle, float world[3][3])
{
    for (int k = 0; k < 3; ++k) {
        const float *p = o->mesh->positions[o->mesh->triangles[triangle][k]];
        if (o->identity) {
            memcpy(world[k], p, sizeof world[k]);
        } else {
            umb_transform_point(&o->transform, p, world[k]);
        }
    }
}

static bool triangle_hidden(const umb_shape_question *q, uint32_t triangle)
{
    float world[3][3];
    umb_hull hull;
    place_triangle(q->object, triangle, world);
    const float(*corners)[3] = (const float(*)[3])world;
    if (is_near(q, corners, 3)) {
        return true;
    }
    bool ready = q->points_only ? umb_hull_points_of_triangle(&hull, q->viewer, corners)
                                : umb_hull_of_triangle(&hull, q->viewer, corners);
    return ready && ask(q, &hull);
}

static bool leaf_hidden(const umb_shape_question *q, const umb_part *part)
{
    for (uint32_t i = part->begin; i < part->end; ++i) {
        if (!triangle_hidden(q, q->object->mesh->part_order[i])) {
            return false;
        }
    }
    return true;
}

/* True if the middle of a triangle is seen: most visible things are found by this alone. */
static bool leaf_middle_shows(const umb_shape_question *q, const umb_part *part)
{
    for (uint32_t i = part->begin; i < part->end; ++i) {
        float world[3][3], middle[3];
        place_triangle(q->object, q->object->mesh->part_order[i], world);
        for (int k = 0; k < 3; ++k) {
            middle[k] = (float)(((double)world[0][k] + world[1][k] + world[2][k]) * (1.0 / 3.0));
        }
        if (is_seen(q, middle)) {
            return true;
        }
    }
    return false;
}

static bool is_box(const umb_object *o)
{
    return o->mesh->box && o->mesh->seen_count == o->mesh->triangle_count;
}

/* It is its own bounds, if it is a box. */
static bool stands_along(const umb_object *o)
{
    const float(*m)[4] = o->transform.m;
    return o->identity || (m[0][1] == 0.0f && m[0][2] == 0.0f && m[1][0] == 0.0f && m[1][2] == 0.0f &&
                           m[2][0] == 0.0f && m[2][1] == 0.0f);
}

bool umb_shape_hull_hidden(const umb_shape_question *q)
{
    const umb_object *o = q->object;
    if (!o->refine || o->mesh == NULL || o->mesh->seen_count == 0) {
        return false;
    }
    if (is_box(o)) {
        return !stands_along(o) && box_hidden(q, 0);
    }
    for (uint32_t i = 0; i < o->mesh->part_count;) {
        const umb_part *part = &o->mesh->parts[i];
        bool leaf = part->skip == i + 1;
        if (leaf && leaf_middle_shows(q, part)) {
            return false;
        }
        if (box_hidden(q, i)) {
            i = part->skip;
        } else if (leaf && !leaf_hidden(q, part)) {
            return false;
        } else {
            i += 1;
        }
    }
    return true;
}
