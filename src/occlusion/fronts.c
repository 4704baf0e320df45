#include "fronts.h"

#include <string.h>

#include "geometry/transform.h"

static void place(const umb_pick *pick, uint32_t vertex, float out[3])
{
    const float *p = pick->facets->positions[vertex];
    if (pick->place->identity) {
        memcpy(out, p, 3 * sizeof *out);
    } else {
        umb_transform_point(&pick->place->transform, p, out);
    }
}

/* 1 if a facet's first triangle is seen from where its corners run counter-clockwise in the world, -1 from behind, 0
 * neither for sure. The others are looked at where the front is added. */
static int seen_side(const umb_shadows *s, const umb_pick *pick, const umb_facet *f)
{
    const uint32_t *corner = pick->facets->triangles[pick->facets->members[f->first_triangle]];
    float p[3][3];
    for (int k = 0; k < 3; ++k) {
        place(pick, corner[k], p[k]);
    }
    umb_seen_line line;
    umb_seen_corner c;
    umb_seen_line_through(&s->viewer.sight, p[0], p[1], &line);
    umb_seen_corner_at(&s->viewer.sight, p[2], &c);
    int side = umb_seen_side(&s->viewer.sight, &line, &c);
    return side == UMB_SEEN_UNKNOWN ? 0 : -side;
}

/* Whether a facet blocks, and how it is then seen: 1, its corners run counter-clockwise; -1, clockwise. */
static int front_side(const umb_shadows *s, const umb_pick *pick, uint32_t facet)
{
    const umb_facet *f = &pick->facets->facets[facet];
    int side = seen_side(s, pick, f), front = pick->place->mirrored ? -1 : 1;
    return side == front || f->two_sided ? side : 0;
}

static bool add_triangles(umb_front_room *room, const umb_pick *pick, const umb_facet *f, int side)
{
    for (uint32_t i = 0; i < f->triangle_count; ++i) {
        const uint32_t *corner = pick->facets->triangles[pick->facets->members[f->first_triangle + i]];
        if (room->triangle_count == UMB_FRONT_TRIANGLES) {
            return false;
        }
        uint32_t at = room->triangle_count++;
        for (uint32_t k = 0; k < 3; ++k) {
            place(pick, corner[side > 0 ? k : 2 - k], room->points[3 * at + k]);
            room->triangles[at][k] = 3 * at + k;
        }
    }
    return true;
}

static bool add_edge(umb_front_room *room, const umb_pick *pick, uint32_t from, uint32_t to)
{
    if (room->edge_count == UMB_SHADOW_LINES) {
        return false;
    }
    uint32_t at = room->edge_count++, point = 3 * UMB_FRONT_TRIANGLES + 2 * at;
    const uint32_t ends[2] = {from, to};
    for (uint32_t k = 0; k < 2; ++k) {
        room->corners[at][k] = ends[k];
        room->edges[at][k] = point + k;
        place(pick, ends[k], room->points[point + k]);
    }
    return true;
}

/* The edges of a facet as they are seen, counter-clockwise, without those to facets of the same front. */
static bool add_edges(umb_front_room *room, const umb_pick *pick, const umb_facet *f, int side, const int8_t *in_front)
{
    const umb_facets *all = pick->facets;
    for (uint32_t i = 0; i < f->count; ++i) {
        uint32_t k = side > 0 ? i : f->count - 1 - i, next = k + 1 < f->count ? k + 1 : 0;
        uint32_t other = all->beyond[f->first + k];
        uint32_t from = all->corners[f->first + k], to = all->corners[f->first + next];
        bool inside = in_front != NULL && other != UMB_NONE && in_front[other] == side;
        if (!inside && !add_edge(room, pick, side > 0 ? from : to, side > 0 ? to : from)) {
            return false;
        }
    }
    return true;
}

static void swap_edges(umb_front_room *room, uint32_t a, uint32_t b)
{
    uint32_t edge[2], corner[2];
    memcpy(edge, room->edges[a], sizeof edge);
    memcpy(corner, room->corners[a], sizeof corner);
    memcpy(room->edges[a], room->edges[b], sizeof edge);
    memcpy(room->corners[a], room->corners[b], sizeof corner);
    memcpy(room->edges[b], edge, sizeof edge);
    memcpy(room->corners[b], corner, sizeof corner);
}

/* Edges in the order of the boundary, as far as it is one loop. */
static void link_edges(umb_front_room *room)
{
    for (uint32_t i = 0; i + 1 < room->edge_count; ++i) {
        for (uint32_t k = i + 1; k < room->edge_count; ++k) {
            if (room->corners[k][0] == room->corners[i][1]) {
                swap_edges(room, i + 1, k);
                break;
            }
        }
    }
}

static umb_shadow_result add_front(umb_shadows *s, umb_front_room *room, const umb_pick *pick, bool whole)
{
    umb_shadow_front front = {.points = (const float(*)[3])room->points,
                              .triangles = (const uint32_t(*)[3])room->triangles,
                              .edges = (const uint32_t(*)[2])room->edges,
                              .triangle_count = room->triangle_count,
                              .edge_count = room->edge_count,
                              .source = pick->occluder};
    return umb_shadows_add(s, &front, whole);
}

static bool add_facet(umb_shadows *s, umb_front_room *room, const umb_pick *pick, uint32_t facet)
{
    const umb_facet *f = &pick->facets->facets[facet];
    int side = front_side(s, pick, facet);
    room->triangle_count = room->edge_count = 0;
    return side != 0 && add_triangles(room, pick, f, side) && add_edges(room, pick, f, side, NULL) &&
           add_front(s, room, pick, false) == UMB_SHADOW_ADDED;
}

static umb_shadow_result add_body(umb_shadows *s, umb_front_room *room, const umb_pick *pick)
{
    const umb_facets *all = pick->facets;
    int8_t sides[UMB_FRONT_TRIANGLES];
    room->triangle_count = room->edge_count = 0;
    for (uint32_t i = 0; i < all->facet_count; ++i) {
        sides[i] = (int8_t)front_side(s, pick, i);
    }
    for (uint32_t i = 0; i < all->facet_count; ++i) {
        const umb_facet *f = &all->facets[i];
        if (sides[i] != 0 && !(add_triangles(room, pick, f, sides[i]) && add_edges(room, pick, f, sides[i], sides))) {
            return UMB_SHADOW_NOTHING;
        }
    }
    link_edges(room);
    return add_front(s, room, pick, true);
}

uint32_t umb_fronts_add(umb_shadows *shadows, umb_front_room *room, const umb_pick *pick)
{
    if (pick->facet != UMB_NONE) {
        return add_facet(shadows, room, pick, pick->facet);
    }
    if (pick->facets->facet_count > UMB_FRONT_TRIANGLES) {
        return 0;
    }
    umb_shadow_result whole = add_body(shadows, room, pick);
    uint32_t count = whole == UMB_SHADOW_ADDED;
    for (uint32_t i = 0; whole == UMB_SHADOW_CUT && i < pick->facets->facet_count; ++i) {
        count += add_facet(shadows, room, pick, i);
    }
    return count;
}
