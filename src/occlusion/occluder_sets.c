#include "occluder_sets.h"

#include <string.h>

#include "base/scratch.h"
#include "scene/position_hash.h"

void umb_occluder_sets_create(umb_occluder_sets *s, const umb_allocator *a)
{
    memset(s, 0, sizeof *s);
    s->allocator = *a;
}

static void forget(umb_occluder_sets *s)
{
    for (uint32_t i = 0; i < s->set_count; ++i) {
        umb_facets_free(&s->sets[i].facets, &s->allocator);
    }
    s->set_count = s->table_size = s->table_used = s->free_count = s->known_count = s->soup_users = 0;
    s->tree = NULL;
    s->known = false;
}

void umb_occluder_sets_free(umb_occluder_sets *s)
{
    const umb_allocator *a = &s->allocator;
    forget(s);
    umb_memory_free(a, s->sets, s->set_capacity * sizeof *s->sets);
    umb_memory_free(a, s->table, s->table_capacity * sizeof *s->table);
    umb_memory_free(a, s->free_sets, s->free_capacity * sizeof *s->free_sets);
    umb_memory_free(a, s->set_of, s->of_capacity * sizeof *s->set_of);
    umb_memory_free(a, s->soup_first, s->first_capacity * sizeof *s->soup_first);
    umb_memory_free(a, s->areas, s->area_capacity * sizeof *s->areas);
    umb_memory_free(a, s->node_areas, s->node_capacity * sizeof *s->node_areas);
    umb_memory_free(a, s->soup.positions, s->soup_position_capacity * sizeof *s->soup.positions);
    umb_memory_free(a, s->soup.triangles, s->soup_triangle_capacity * sizeof *s->soup.triangles);
    umb_memory_free(a, s->soup_tags, s->soup_tag_capacity * sizeof *s->soup_tags);
    umb_memory_free(a, s->soup_sides, s->soup_side_capacity);
    memset(s, 0, sizeof *s);
}

/* ---- welded surfaces ---------------------------------------------------------------------------- */

/* The surfaces that stand in world coordinates, as one: equal positions are one vertex, equal triangles one. Surfaces of
 * different masks have nothing in common, for a view may have one of them alone. */
typedef struct soup_maker {
    umb_occluder_sets *s;
    uint32_t *by_position, *by_triangle; /* open tables of numbers */
    uint32_t *masks;                     /* of each vertex */
    uint32_t position_slots, triangle_slots;
} soup_maker;

static uint32_t slots_for(size_t count)
{
    uint32_t slots = 16;
    while (slots < 2 * count) {
        slots *= 2;
    }
    return slots;
}

static uint32_t soup_vertex(soup_maker *m, const float p[3], uint32_t mask)
{
    const float folded[3] = {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f};
    uint32_t at = umb_position_hash(folded) & (m->position_slots - 1);
    for (; m->by_position[at] != UMB_NONE; at = (at + 1) & (m->position_slots - 1)) {
        uint32_t known = m->by_position[at];
        if (m->masks[known] == mask && memcmp(m->s->soup.positions[known], folded, sizeof folded) == 0) {
            return known;
        }
    }
    uint32_t number = m->s->soup_positions++;
    m->masks[number] = mask;
    memcpy(m->s->soup.positions[number], folded, sizeof folded);
    m->by_position[at] = number;
    return number;
}

static void soup_triangle(soup_maker *m, const umb_committed *scene, uint32_t t, uint32_t tag)
{
    umb_occluder_sets *s = m->s;
    const umb_occluder *o = &scene->occluders[tag];
    uint32_t v[3], turned[3], low = 0;
    for (int k = 0; k < 3; ++k) {
        v[k] = soup_vertex(m, o->mesh->positions[o->mesh->triangles[t][k]], scene->occluder_masks[tag]);
        low = v[k] < v[low] ? (uint32_t)k : low;
    }
    for (uint32_t k = 0; k < 3; ++k) {
        turned[k] = v[(low + k) % 3];
    }
    uint64_t h = turned[0] * 0x9E3779B97F4A7C15u ^ turned[1] * 0xBF58476D1CE4E5B9u ^ turned[2] * 0x94D049BB133111EBu;
    uint32_t at = (uint32_t)(h >> 32) & (m->triangle_slots - 1);
    for (; m->by_triangle[at] != UMB_NONE; at = (at + 1) & (m->triangle_slots - 1)) {
        if (memcmp(s->soup.triangles[m->by_triangle[at]], turned, sizeof turned) == 0) {
            return;
        }
    }
    uint32_t number = s->soup.triangle_count++;
    m->by_triangle[at] = number;
    memcpy(s->soup.triangles[number], turned, sizeof turned);
    s->soup_tags[number] = tag;
    s->soup_sides[number] = o->mesh->two_sided[t];
}

static bool reserve_soup(umb_occluder_sets *s, size_t positions, size_t triangles)
{
    const umb_allocator *a = &s->allocator;
    return umb_memory_reserve(a, (void **)&s->soup.positions, &s->soup_position_capacity, positions,
                              sizeof *s->soup.positions) &&
           umb_memory_reserve(a, (void **)&s->soup_tags, &s->soup_tag_capacity, triangles, sizeof *s->soup_tags) &&
           umb_memory_reserve(a, (void **)&s->soup_sides, &s->soup_side_capacity, triangles, 1) &&
           umb_memory_reserve(a, (void **)&s->soup.triangles, &s->soup_triangle_capacity, triangles,
                              sizeof *s->soup.triangles);
}

static bool make_soup(umb_occluder_sets *s, const umb_committed *scene)
{
    size_t positions = 0, triangles = 0;
    for (uint32_t i = 0; i < scene->occluder_count; ++i) {
        if (umb_occluder_is_welded(&scene->occluders[i])) {
            positions += scene->occluders[i].mesh->position_count;
            triangles += scene->occluders[i].mesh->triangle_count;
        }
    }
    umb_scratch scratch = {.allocator = &s->allocator};
    soup_maker m = {.s = s, .position_slots = slots_for(positions), .triangle_slots = slots_for(triangles)};
    m.by_position = umb_scratch_get(&scratch, m.position_slots, sizeof *m.by_position);
    m.by_triangle = umb_scratch_get(&scratch, m.triangle_slots, sizeof *m.by_triangle);
    m.masks = umb_scratch_get(&scratch, positions, sizeof *m.masks);
    s->soup.triangle_count = s->soup_positions = 0;
    bool ok = !scratch.failed && reserve_soup(s, positions, triangles);
    if (ok) {
        memset(m.by_position, 0xFF, m.position_slots * sizeof *m.by_position);
        memset(m.by_triangle, 0xFF, m.triangle_slots * sizeof *m.by_triangle);
        for (uint32_t i = 0; i < scene->occluder_count; ++i) {
            const umb_occluder *o = &scene->occluders[i];
            for (uint32_t t = 0; umb_occluder_is_welded(o) && t < o->mesh->triangle_count; ++t) {
                soup_triangle(&m, scene, t, i);
            }
        }
        s->soup.tags = s->soup_tags;
        s->soup.two_sided = s->soup_sides;
    }
    umb_scratch_free(&scratch);
    s->welds += 1;
    umb_facets_free(&s->sets[UMB_SET_WELDED].facets, &s->allocator);
    return ok && umb_facets_build(&s->sets[UMB_SET_WELDED].facets, &s->allocator, &s->soup);
}

/* Where each occluder's facets begin in the welded set. */
static void share_soup(umb_occluder_sets *s, const umb_committed *scene)
{
    const umb_facets *soup = &s->sets[UMB_SET_WELDED].facets;
    uint32_t at = 0;
    for (uint32_t i = 0; i <= scene->occluder_count; ++i) {
        while (at < soup->facet_count && soup->facets[at].tag < i) {
            at += 1;
        }
        s->soup_first[i] = at;
    }
}

/* ---- sets of meshes ----------------------------------------------------------------------------- */

/* Where a mesh is in the table, or would be. */
static uint32_t table_place(const umb_occluder_sets *s, const umb_mesh *mesh)
{
    uint64_t h = (uint64_t)(uintptr_t)mesh * 0x9E3779B97F4A7C15u;
    uint32_t at = (uint32_t)(h >> 32) & (s->table_size - 1);
    while (s->table[at] != UMB_NONE && s->sets[s->table[at]].mesh != mesh) {
        at = (at + 1) & (s->table_size - 1);
    }
    return at;
}

/* A table for so many sets, with those that there are. */
static bool make_table(umb_occluder_sets *s, uint32_t count)
{
    uint32_t size = slots_for(count);
    if (!umb_memory_reserve(&s->allocator, (void **)&s->table, &s->table_capacity, size, sizeof *s->table)) {
        return false;
    }
    memset(s->table, 0xFF, size * sizeof *s->table);
    s->table_size = size;
    s->table_used = 0;
    for (uint32_t i = 1; i < s->set_count; ++i) {
        if (s->sets[i].mesh != NULL) {
            s->table[table_place(s, s->sets[i].mesh)] = i;
            s->table_used += 1;
        }
    }
    return true;
}

static bool make_set(umb_occluder_sets *s, const umb_mesh *mesh, uint32_t *number)
{
    umb_facet_source source = {.positions = mesh->positions,
                               .triangles = mesh->triangles,
                               .two_sided = mesh->two_sided,
                               .triangle_count = mesh->triangle_count};
    const umb_allocator *a = &s->allocator;
    if (!umb_memory_reserve(a, (void **)&s->sets, &s->set_capacity, s->set_count + 1, sizeof *s->sets) ||
        !umb_memory_reserve(a, (void **)&s->free_sets, &s->free_capacity, s->set_count + 1, sizeof *s->free_sets)) {
        return false;
    }
    uint32_t at = s->free_count > 0 ? s->free_sets[--s->free_count] : s->set_count++;
    s->sets[at] = (umb_mesh_facets){.mesh = mesh};
    *number = at;
    return umb_facets_build(&s->sets[at].facets, a, &source);
}

/* The set of an occluder that has come. */
static bool take_set(umb_occluder_sets *s, const umb_committed *scene, uint32_t occluder)
{
    const umb_occluder *o = &scene->occluders[occluder];
    if (umb_occluder_is_welded(o)) {
        s->set_of[occluder] = UMB_SET_WELDED;
        s->soup_users += 1;
        return true;
    }
    if (s->table_used >= s->table_size / 2 && !make_table(s, 2 * (s->set_count - s->free_count) + 16)) {
        return false;
    }
    uint32_t at = table_place(s, o->mesh), number = s->table[at];
    if (number == UMB_NONE) {
        if (!make_set(s, o->mesh, &number)) {
            return false;
        }
        s->table[at] = number;
        s->table_used += 1;
    }
    s->sets[number].users += 1;
    s->set_of[occluder] = number;
    return true;
}

/* Close the gap that an entry leaves in the table: what comes behind it may have been pushed there. */
static void take_out(umb_occluder_sets *s, const umb_mesh *mesh)
{
    uint32_t at = table_place(s, mesh), mask = s->table_size - 1;
    s->table[at] = UMB_NONE;
    s->table_used -= 1;
    for (at = (at + 1) & mask; s->table[at] != UMB_NONE; at = (at + 1) & mask) {
        uint32_t number = s->table[at];
        s->table[at] = UMB_NONE;
        s->table[table_place(s, s->sets[number].mesh)] = number;
    }
}

/* The mesh may be gone already. */
static void give_set(umb_occluder_sets *s, uint32_t number)
{
    if (number == UMB_SET_WELDED) {
        s->soup_users -= 1;
        return;
    }
    umb_mesh_facets *set = &s->sets[number];
    if (--set->users == 0) {
        take_out(s, set->mesh);
        umb_facets_free(&set->facets, &s->allocator);
        set->mesh = NULL;
        s->free_sets[s->free_count++] = number;
    }
}

/* ---- areas -------------------------------------------------------------------------------------- */

/* What a transform does to areas, at most. */
static float area_scale(const umb_occluder *o)
{
    float most = 0.0f;
    for (int k = 0; k < 3 && !o->identity; ++k) {
        float x = o->transform.m[0][k], y = o->transform.m[1][k], z = o->transform.m[2][k];
        float square = x * x + y * y + z * z;
        most = square > most ? square : most;
    }
    return o->identity ? 1.0f : most;
}

bool umb_occluder_is_body(const umb_occluder_sets *s, const umb_committed *scene, uint32_t occluder)
{
    return scene->occluders[occluder].mesh->convex && s->sets[s->set_of[occluder]].facets.facet_count <= UMB_BODY_FACETS;
}

static float area_of(const umb_occluder_sets *s, const umb_committed *scene, uint32_t occluder)
{
    uint32_t set = s->set_of[occluder];
    const umb_facets *f = &s->sets[set].facets;
    const umb_occluder *o = &scene->occluders[occluder];
    if (set == UMB_SET_WELDED) {
        uint32_t first = s->soup_first[occluder];
        return first < s->soup_first[occluder + 1] ? f->sizes[first] : 0.0f;
    }
    if (umb_occluder_is_body(s, scene, occluder)) {
        float sum = 0.0f;
        for (uint32_t i = 0; i < f->facet_count; ++i) {
            sum += f->sizes[i];
        }
        return 0.5f * sum * area_scale(o);
    }
    return f->facet_count > 0 ? f->sizes[0] * area_scale(o) : 0.0f;
}

static float slot_area(const umb_occluder_sets *s, const umb_committed *scene, uint32_t ref)
{
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        return s->node_areas[ref & UMB_REF_NUMBER];
    }
    uint32_t o = umb_occluder_of(scene, ref);
    return o != UMB_NONE ? s->areas[o] : 0.0f;
}

/* True if that is news. */
static bool sum_up_node(umb_occluder_sets *s, const umb_choice *c, uint32_t number)
{
    const umb_node *node = umb_tree_node(c->tree, number);
    float most = 0.0f, before = s->node_areas[number];
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        float area = slot_area(s, c->scene, node->ref[slot]);
        most = area > most ? area : most;
    }
    s->node_areas[number] = most;
    return most != before;
}

/* Children come after their parents; a block's after the nodes, its children before it. */
static void sum_up_all(umb_occluder_sets *s, const umb_choice *c)
{
    const umb_tree *tree = c->tree;
    uint32_t all = tree->node_count + tree->block_count;
    for (uint32_t i = 0; i < all; ++i) {
        (void)sum_up_node(s, c, i < tree->node_count ? tree->node_count - 1 - i : i);
    }
}

/* From a node up, as far as it is news. A child that is put right later tells its parents then. */
static void sum_up_from(umb_occluder_sets *s, const umb_choice *c, uint32_t number)
{
    while (number != UMB_NONE && sum_up_node(s, c, number)) {
        number = c->tree->nodes[number].parent;
    }
}

/* The area of one occluder; where it is news, what is above it. */
static void follow_area(umb_occluder_sets *s, const umb_choice *c, uint32_t occluder, bool lift)
{
    const umb_occluder *o = &c->scene->occluders[occluder];
    float area = area_of(s, c->scene, occluder), before = s->areas[occluder];
    s->areas[occluder] = area;
    if (lift && area != before) {
        uint32_t place = o->owner != UMB_NONE ? c->tree->places[o->owner] : c->tree->occluder_places[occluder];
        sum_up_from(s, c, place != UMB_NONE ? place / UMB_NODE_WIDTH : UMB_NONE);
    }
}

/* ---- following ---------------------------------------------------------------------------------- */

static bool reserve(umb_occluder_sets *s, const umb_choice *c)
{
    const umb_allocator *a = &s->allocator;
    size_t n = c->scene->occluder_count, nodes = (size_t)c->tree->node_count + c->tree->block_count, old = s->node_capacity;
    if (!umb_memory_reserve(a, (void **)&s->set_of, &s->of_capacity, n, sizeof *s->set_of) ||
        !umb_memory_reserve(a, (void **)&s->soup_first, &s->first_capacity, n + 1, sizeof *s->soup_first) ||
        !umb_memory_reserve(a, (void **)&s->areas, &s->area_capacity, n, sizeof *s->areas) ||
        !umb_memory_reserve(a, (void **)&s->node_areas, &s->node_capacity, nodes, sizeof *s->node_areas) ||
        !umb_memory_reserve(a, (void **)&s->sets, &s->set_capacity, 1, sizeof *s->sets)) {
        return false;
    }
    for (; old < s->node_capacity; ++old) {
        s->node_areas[old] = 0.0f;
    }
    for (size_t i = s->known_count; i < n; ++i) {
        s->areas[i] = 0.0f;
    }
    return true;
}

/* All sets anew. */
static bool make_all(umb_occluder_sets *s, const umb_committed *scene)
{
    bool ok = true;
    forget(s);
    s->sets[s->set_count++] = (umb_mesh_facets){.mesh = NULL};
    for (uint32_t i = 0; i < scene->occluder_count && ok; ++i) {
        ok = take_set(s, scene, i);
    }
    if (!ok || !make_soup(s, scene)) {
        return false;
    }
    share_soup(s, scene);
    return true;
}

/* What came takes sets only after what went has given them up: a mesh may stand where another one stood. *welded becomes
 * true if the welded surfaces changed: any of them may have other facets then. */
static bool follow_replaced(umb_occluder_sets *s, const umb_committed *scene, bool *welded)
{
    bool soup = false, ok = true;
    for (uint32_t i = 0; i < scene->replaced_count; ++i) {
        uint32_t number = scene->replaced[i];
        if (number < s->known_count) {
            soup = soup || s->set_of[number] == UMB_SET_WELDED;
            give_set(s, s->set_of[number]);
        }
    }
    for (uint32_t i = 0; i < scene->replaced_count && ok; ++i) {
        uint32_t number = scene->replaced[i];
        if (number < scene->occluder_count) {
            ok = take_set(s, scene, number);
            soup = soup || s->set_of[number] == UMB_SET_WELDED;
        }
    }
    if (!ok || (soup && !make_soup(s, scene))) {
        return false;
    }
    if (soup || scene->occluder_count != s->known_count) {
        share_soup(s, scene);
    }
    *welded = soup;
    return true;
}

/* Areas of what the lists name. */
static void follow_areas(umb_occluder_sets *s, const umb_choice *c, bool grew, bool lift)
{
    const umb_committed *scene = c->scene;
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        uint32_t occluder = scene->objects[scene->moved[i]].occluder;
        if (occluder != UMB_NONE) {
            follow_area(s, c, occluder, lift);
        }
    }
    for (uint32_t i = 0; i < scene->replaced_count && grew; ++i) {
        if (scene->replaced[i] < scene->occluder_count) {
            follow_area(s, c, scene->replaced[i], lift);
        }
    }
}

/* Nodes that were touched are summed up, and what is above them. */
static void follow_nodes(umb_occluder_sets *s, const umb_choice *c)
{
    for (uint32_t i = 0; i < c->tree->touched_count; ++i) {
        sum_up_from(s, c, c->tree->touched[i]);
    }
}

static void sum_up(umb_occluder_sets *s, const umb_choice *c, bool grew, bool next)
{
    const umb_tree *tree = c->tree;
    bool lift = next && s->tree == tree && !tree->several && !tree->flat && tree->touched_count != UMB_TOUCHED_ALL;
    for (uint32_t i = 0; lift && i < tree->touched_count; ++i) {
        s->node_areas[tree->touched[i]] = -1.0f; /* whatever comes is news */
    }
    if (next) {
        follow_areas(s, c, grew, lift);
    }
    for (uint32_t i = 0; !next && i < c->scene->occluder_count; ++i) {
        s->areas[i] = area_of(s, c->scene, i);
    }
    if (lift) {
        follow_nodes(s, c);
    } else {
        sum_up_all(s, c);
    }
}

bool umb_occluder_sets_follow(umb_occluder_sets *s, const umb_choice *c)
{
    const umb_committed *scene = c->scene;
    bool known = s->known, grew = s->structure != scene->structure;
    if (known && s->version == scene->version) {
        return true;
    }
    /* The lists of what came are of the last growth, those of what moved of the last commit. */
    bool follows = known && (!grew || s->structure + 1 == scene->structure);
    bool welded = false;
    s->known = false;
    if (!reserve(s, c) || (follows ? grew && !follow_replaced(s, scene, &welded) : !make_all(s, scene))) {
        forget(s);
        return false;
    }
    sum_up(s, c, grew, follows && !welded && s->version + 1 == scene->version);
    s->tree = c->tree;
    s->known_count = scene->occluder_count;
    s->structure = scene->structure;
    s->version = scene->version;
    s->known = true;
    return true;
}
