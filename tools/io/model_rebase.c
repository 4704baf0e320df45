/* Moving far scenes to the origin without moving a vertex.
 *
 * Sterbenz: for floats x and o with o/2 <= x <= 2o the difference x - o is a float. The origin
 * is chosen so that every coordinate of the box lies in that range of it; transforms are changed
 * only where the new translation is a float too, so that the world vertices are the same real
 * numbers as before, minus the origin, rounded more finely. */
#include "model_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Distance between floats of the size of x. */
static double float_step(double x)
{
    int exponent;
    frexp(x, &exponent);
    return ldexp(1.0, exponent - 24);
}

void model_choose_origin(const double min[3], const double max[3], double origin[3])
{
    double extent = 0.0;
    for (int i = 0; i < 3; ++i) {
        extent = fmax(extent, max[i] - min[i]);
    }
    for (int i = 0; i < 3; ++i) {
        double centre = 0.5 * (min[i] + max[i]);
        origin[i] = 0.0;
        if (!(extent > 0.0) || !(fabs(centre) > 8.0 * extent)) {
            continue;
        }
        int exponent;
        frexp(extent, &exponent);
        double unit = fmax(ldexp(1.0, exponent - 4), float_step(fmax(fabs(min[i]), fabs(max[i]))));
        double candidate = nearbyint(centre / unit) * unit;
        if ((double)(float)candidate == candidate) {
            origin[i] = candidate;
        }
    }
}

static bool linear_part_is_identity(const umb_transform *t)
{
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            if (t->m[i][j] != (i == j ? 1.0f : 0.0f)) {
                return false;
            }
        }
    }
    return true;
}

static bool exact_difference(float x, double origin)
{
    double difference = (double)x - origin;
    return (double)(float)difference == difference && difference + origin == (double)x;
}

/* What the instances of a mesh have in common: bits that each of them may take away. */
enum {
    ALL_LINEAR_IDENTITY = 1, /* the linear part is the identity */
    ALL_IDENTITY = 2,        /* ... and there is no translation */
    ALL_EXACT = 4,           /* the translation minus the origin is a float */
    VERTICES_EXACT = 8       /* so is every vertex minus the origin */
};

static void look_at_instances(const model *m, uint8_t *common)
{
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const umb_transform *t = &m->objects[i].transform;
        if (m->objects[i].mesh == MODEL_NONE) {
            continue;
        }
        uint8_t *bits = &common[m->objects[i].mesh];
        if (!linear_part_is_identity(t)) {
            *bits &= (uint8_t) ~(ALL_LINEAR_IDENTITY | ALL_IDENTITY);
        }
        for (int k = 0; k < 3; ++k) {
            if (t->m[k][3] != 0.0f) {
                *bits &= (uint8_t)~ALL_IDENTITY;
            }
            if (!exact_difference(t->m[k][3], m->origin[k])) {
                *bits &= (uint8_t)~ALL_EXACT;
            }
        }
    }
}

static void look_at_vertices(const model *m, uint8_t *common)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        const model_mesh *mesh = &m->meshes[i];
        for (size_t v = 0; v < 3 * (size_t)mesh->position_count; ++v) {
            if (!exact_difference(mesh->positions[v], m->origin[v % 3])) {
                common[i] &= (uint8_t)~VERTICES_EXACT;
                break;
            }
        }
    }
}

/* Vertices are moved where that leaves an identity (the library keeps such vertices as they are) or
 * where the translation cannot be; else the translation is. */
static bool moves_vertices(uint8_t common)
{
    bool possible = (common & VERTICES_EXACT) != 0 && (common & ALL_LINEAR_IDENTITY) != 0;
    return possible && ((common & ALL_IDENTITY) != 0 || (common & ALL_EXACT) == 0);
}

static void move_everything(model *m, const uint8_t *common)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        model_mesh *mesh = &m->meshes[i];
        if (moves_vertices(common[i])) {
            for (size_t v = 0; v < 3 * (size_t)mesh->position_count; ++v) {
                mesh->positions[v] = (float)(mesh->positions[v] - m->origin[v % 3]);
            }
        }
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        model_object *o = &m->objects[i];
        if (o->mesh == MODEL_NONE || moves_vertices(common[o->mesh])) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            o->transform.m[k][3] = (float)(o->transform.m[k][3] - m->origin[k]);
        }
    }
}

bool model_rebase(model *m)
{
    double min[3];
    double max[3];
    for (int k = 0; k < 3; ++k) {
        min[k] = m->bounds.min[k];
        max[k] = m->bounds.max[k];
    }
    model_choose_origin(min, max, m->origin);
    if (m->origin[0] == 0.0 && m->origin[1] == 0.0 && m->origin[2] == 0.0) {
        return true;
    }
    uint8_t *common = malloc((size_t)m->mesh_count + 1);
    if (common == NULL) {
        return false;
    }
    memset(common, ALL_LINEAR_IDENTITY | ALL_IDENTITY | ALL_EXACT | VERTICES_EXACT, m->mesh_count);
    look_at_instances(m, common);
    look_at_vertices(m, common);
    bool possible = true;
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        possible = possible && (moves_vertices(common[i]) || (common[i] & ALL_EXACT) != 0);
    }
    if (possible) {
        move_everything(m, common);
    } else {
        memset(m->origin, 0, sizeof m->origin);
    }
    free(common);
    return true;
}
