#include "generate_parts.h"

#include <stdlib.h>
#include <string.h>

uint64_t generate_next(generate_random *r)
{
    uint64_t z = (r->state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

double generate_unit(generate_random *r)
{
    return (double)(generate_next(r) >> 40) / 16777216.0;
}

uint32_t generate_below(generate_random *r, uint32_t count)
{
    return (uint32_t)((generate_next(r) >> 32) * count >> 32);
}

generate_random generate_stream(uint64_t seed, int64_t a, int64_t b)
{
    generate_random r = {seed};
    r.state = generate_next(&r) ^ (uint64_t)a;
    r.state = generate_next(&r) ^ (uint64_t)b;
    r.state = generate_next(&r);
    return r;
}

/* Room for one more element; the capacity doubles. */
static bool reserve(void **array, uint32_t *capacity, uint32_t count, size_t size)
{
    if (count < *capacity) {
        return true;
    }
    uint32_t grown = *capacity ? *capacity * 2 : 16;
    void *moved = realloc(*array, grown * size);
    if (!moved) {
        return false;
    }
    *array = moved;
    *capacity = grown;
    return true;
}

uint32_t generate_vertex(generate_mesh *g, double x, double y, double z)
{
    void *array = g->mesh.positions;
    if (!reserve(&array, &g->position_capacity, g->mesh.position_count, 3 * sizeof(float))) {
        g->failed = true;
        return 0;
    }
    g->mesh.positions = array;
    float *p = g->mesh.positions + 3 * (size_t)g->mesh.position_count;
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    return g->mesh.position_count++;
}

void generate_triangle(generate_mesh *g, uint32_t a, uint32_t b, uint32_t c)
{
    void *array = g->mesh.indices;
    if (!reserve(&array, &g->triangle_capacity, g->mesh.triangle_count, 3 * sizeof(uint32_t))) {
        g->failed = true;
        return;
    }
    g->mesh.indices = array;
    uint32_t *i = g->mesh.indices + 3 * (size_t)g->mesh.triangle_count++;
    i[0] = a;
    i[1] = b;
    i[2] = c;
}

void generate_quad(generate_mesh *g, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    generate_triangle(g, a, b, c);
    generate_triangle(g, a, c, d);
}

void generate_box_faces(generate_mesh *g, const uint32_t corners[8])
{
    static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (int f = 0; f < 6; ++f) {
        generate_quad(g, corners[faces[f][0]], corners[faces[f][1]], corners[faces[f][2]],
                      corners[faces[f][3]]);
    }
}

void generate_box(generate_mesh *g, const double min[3], const double max[3])
{
    uint32_t corners[8];
    for (int k = 0; k < 8; ++k) {
        corners[k] = generate_vertex(g, k & 1 ? max[0] : min[0], k & 2 ? max[1] : min[1],
                                     k & 4 ? max[2] : min[2]);
    }
    generate_box_faces(g, corners);
}

uint32_t generate_mesh_add(generate_mesh *g, model *m)
{
    uint32_t id = g->failed ? MODEL_NONE : model_add_mesh(m, &g->mesh);
    g->mesh.position_count = 0;
    g->mesh.triangle_count = 0;
    return id;
}

void generate_mesh_free(generate_mesh *g)
{
    free(g->mesh.positions);
    free(g->mesh.indices);
    memset(g, 0, sizeof *g);
}

bool generate_look(camera_path *p, const double eye[3], const double target[3])
{
    /* Paths are short: growing row by row is simplest. */
    void *rows = realloc(p->rows, ((size_t)p->count + 1) * sizeof *p->rows);
    if (!rows) {
        return false;
    }
    p->rows = rows;
    for (int i = 0; i < 3; ++i) {
        p->rows[p->count][i] = eye[i];
        p->rows[p->count][i + 3] = target[i];
    }
    ++p->count;
    return true;
}

umb_transform generate_translation(double x, double y, double z)
{
    umb_transform t = {{{1, 0, 0, (float)x}, {0, 1, 0, (float)y}, {0, 0, 1, (float)z}}};
    return t;
}
