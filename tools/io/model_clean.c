/* Taking away what no scene can hold: the library refuses vertices that are not finite and indices
 * that are out of range, so a model has none of them after model_finish(). */
#include "model_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Marks of a vertex. */
enum { VERTEX_FINITE = 1, VERTEX_USED = 2 };

/* Keep the triangles whose three vertices exist and are finite; mark those vertices used. */
static void drop_triangles(model_mesh *mesh, uint8_t *marks, model_faults *faults)
{
    uint32_t kept = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        const uint32_t *corner = mesh->indices + 3 * (size_t)t;
        bool in_range = true;
        bool finite = true;
        for (int i = 0; i < 3; ++i) {
            in_range = in_range && corner[i] < mesh->position_count;
            finite = finite && in_range && (marks[corner[i]] & VERTEX_FINITE) != 0;
        }
        faults->bad_indices += !in_range;
        if (!finite) {
            continue;
        }
        for (int i = 0; i < 3; ++i) {
            marks[corner[i]] |= VERTEX_USED;
            mesh->indices[3 * (size_t)kept + i] = corner[i];
        }
        mesh->flags[kept++] = mesh->flags[t];
    }
    mesh->triangle_count = kept;
}

/* Close the gaps that unused vertices leave; vertices keep their order. */
static void drop_vertices(model_mesh *mesh, const uint8_t *marks, uint32_t *renumbered)
{
    uint32_t kept = 0;
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        if ((marks[v] & VERTEX_USED) != 0) {
            memmove(mesh->positions + 3 * (size_t)kept, mesh->positions + 3 * (size_t)v,
                    3 * sizeof(float));
            renumbered[v] = kept++;
        }
    }
    if (kept != mesh->position_count) {
        for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; ++i) {
            mesh->indices[i] = renumbered[mesh->indices[i]];
        }
        mesh->position_count = kept;
    }
}

static bool clean_mesh(model_mesh *mesh, model_faults *faults)
{
    uint8_t *marks = calloc((size_t)mesh->position_count + 1, 1);
    uint32_t *renumbered = malloc(((size_t)mesh->position_count + 1) * sizeof *renumbered);
    if (marks == NULL || renumbered == NULL) {
        free(marks);
        free(renumbered);
        return false;
    }
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        const float *p = mesh->positions + 3 * (size_t)v;
        bool finite = isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
        marks[v] = finite ? VERTEX_FINITE : 0;
        faults->non_finite += !finite;
    }
    drop_triangles(mesh, marks, faults);
    drop_vertices(mesh, marks, renumbered);
    free(marks);
    free(renumbered);
    return true;
}

bool model_clean(model *m)
{
    uint32_t *renumbered = malloc(((size_t)m->mesh_count + 1) * sizeof *renumbered);
    if (renumbered == NULL) {
        return false;
    }
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        if (!clean_mesh(&m->meshes[i], &m->faults)) {
            free(renumbered);
            return false;
        }
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        model_mesh mesh = m->meshes[i];
        if (mesh.triangle_count == 0) {
            free(mesh.positions);
            free(mesh.indices);
            free(mesh.flags);
            renumbered[i] = MODEL_NONE;
            continue;
        }
        m->meshes[kept] = mesh;
        renumbered[i] = kept++;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t mesh = m->objects[i].mesh;
        m->objects[i].mesh = mesh < m->mesh_count ? renumbered[mesh] : MODEL_NONE;
    }
    m->mesh_count = kept;
    free(renumbered);
    return true;
}
