#include "select.h"

#include <string.h>

#include "base/scratch.h"
#include "base/sort.h"
#include "geometry/transform.h"
#include "measure.h"
#include "scene/position_hash.h"

/* Of one occluder so many facets are candidates, the largest. */
#define MOST_FACETS 64
/* Nothing looks larger than this. */
#define FULL_ANGLE 12.6f
#define LONGEST_REST 8

double umb_select_reach(const umb_choice *choice)
{
    const umb_aabb *b = &choice->tree->bounds;
    double reach = 0.0;
    for (int k = 0; k < 3; ++k) {
        reach = fmax(reach, fmax(fabs((double)b->min[k]), fabs((double)b->max[k])));
    }
    return reach;
}

void umb_selector_create(umb_selector *s, const umb_allocator *a)
{
    memset(s, 0, sizeof *s);
    s->allocator = *a;
}

static void free_sets(umb_selector *s)
{
    const umb_allocator *a = &s->allocator;
    for (uint32_t i = 0; i < s->set_count; ++i) {
        umb_facets_free(&s->sets[i], a);
    }
    s->set_count = 0;
    s->known = false;
}

void umb_selector_free(umb_selector *s)
{
    const umb_allocator *a = &s->allocator;
    free_sets(s);
    umb_memory_free(a, s->sets, s->set_capacity * sizeof *s->sets);
    umb_memory_free(a, s->set_of, s->of_capacity * sizeof *s->set_of);
    umb_memory_free(a, s->soup_first, s->first_capacity * sizeof *s->soup_first);
    umb_memory_free(a, s->areas, s->area_capacity * sizeof *s->areas);
    umb_memory_free(a, s->node_areas, s->node_capacity * sizeof *s->node_areas);
    umb_memory_free(a, s->rests, s->rest_capacity * sizeof *s->rests);
    umb_memory_free(a, s->heap, s->heap_capacity * sizeof *s->heap);
    umb_memory_free(a, s->soup.positions, s->soup_position_capacity * sizeof *s->soup.positions);
    umb_memory_free(a, s->soup.triangles, s->soup_triangle_capacity * sizeof *s->soup.triangles);
    umb_memory_free(a, s->soup_tags, s->soup_tag_capacity * sizeof *s->soup_tags);
    umb_memory_free(a, s->soup_sides, s->soup_side_capacity);
    memset(s, 0, sizeof *s);
}

/* ---- what there is --------------------------------------------------------------------------- */

/* A body that stands alone is one, whoever made it. */
static bool is_welded(const umb_occluder *o)
{
    return o->owner == UMB_NONE && o->identity && !o->moves && !o->mesh->convex;
}

/* The surfaces that stand in world coordinates, as one: equal positions are one vertex, equal triangles one. Surfaces of
 * different masks have nothing in common, for a view may have one of them alone. */
typedef struct soup_maker {
    umb_selector *s;
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
    umb_selector *s = m->s;
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

static bool reserve_soup(umb_selector *s, size_t positions, size_t triangles)
{
    const umb_allocator *a = &s->allocator;
    return umb_memory_reserve(a, (void **)&s->soup.positions, &s->soup_position_capacity, positions,
                              sizeof *s->soup.positions) &&
           umb_memory_reserve(a, (void **)&s->soup_tags, &s->soup_tag_capacity, triangles, sizeof *s->soup_tags) &&
           umb_memory_reserve(a, (void **)&s->soup_sides, &s->soup_side_capacity, triangles, 1) &&
           umb_memory_reserve(a, (void **)&s->soup.triangles, &s->soup_triangle_capacity, triangles,
                              sizeof *s->soup.triangles);
}

static bool make_soup(umb_selector *s, const umb_committed *scene)
{
    size_t positions = 0, triangles = 0;
    for (uint32_t i = 0; i < scene->occluder_count; ++i) {
        if (is_welded(&scene->occluders[i])) {
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
            for (uint32_t t = 0; is_welded(o) && t < o->mesh->triangle_count; ++t) {
                soup_triangle(&m, scene, t, i);
            }
        }
        s->soup.tags = s->soup_tags;
        s->soup.two_sided = s->soup_sides;
    }
    umb_scratch_free(&scratch);
    return ok && umb_facets_build(&s->sets[s->set_count++], &s->allocator, &s->soup);
}

/* Where each occluder's facets begin in the welded set. */
static void share_soup(umb_selector *s, const umb_committed *scene)
{
    const umb_facets *soup = &s->sets[s->set_count - 1];
    uint32_t at = 0;
    for (uint32_t i = 0; i <= scene->occluder_count; ++i) {
        while (at < soup->facet_count && soup->facets[at].tag < i) {
            at += 1;
        }
        s->soup_first[i] = at;
    }
}

static bool make_set(umb_selector *s, const umb_mesh *mesh)
{
    umb_facet_source source = {.positions = mesh->positions,
                               .triangles = mesh->triangles,
                               .two_sided = mesh->two_sided,
                               .triangle_count = mesh->triangle_count};
    return umb_facets_build(&s->sets[s->set_count++], &s->allocator, &source);
}

/* One set for each mesh. */
static bool make_sets(umb_selector *s, const umb_committed *scene)
{
    umb_scratch scratch = {.allocator = &s->allocator};
    uint32_t n = scene->occluder_count;
    uint64_t *keys = umb_scratch_get(&scratch, n, sizeof *keys);
    uint64_t *other_keys = umb_scratch_get(&scratch, n, sizeof *other_keys);
    uint32_t *numbers = umb_scratch_get(&scratch, n, sizeof *numbers);
    uint32_t *other = umb_scratch_get(&scratch, n, sizeof *other);
    bool ok = !scratch.failed;
    for (uint32_t i = 0; i < n && ok; ++i) {
        keys[i] = is_welded(&scene->occluders[i]) ? UINT64_MAX : (uint64_t)(uintptr_t)scene->occluders[i].mesh;
        numbers[i] = i;
    }
    if (ok) {
        umb_sort_keys(keys, numbers, other_keys, other, n);
    }
    uint32_t count = 1; /* of the welded ones */
    for (uint32_t i = 0; i < n && ok; ++i) {
        count += keys[i] != UINT64_MAX && (i == 0 || keys[i] != keys[i - 1]);
    }
    ok = ok && umb_memory_reserve(&s->allocator, (void **)&s->sets, &s->set_capacity, count, sizeof *s->sets);
    for (uint32_t i = 0; i < n && ok; ++i) {
        if (keys[i] != UINT64_MAX && (i == 0 || keys[i] != keys[i - 1])) {
            ok = make_set(s, scene->occluders[numbers[i]].mesh);
        }
        s->set_of[numbers[i]] = keys[i] != UINT64_MAX ? s->set_count - 1 : count - 1;
    }
    umb_scratch_free(&scratch);
    return ok && make_soup(s, scene);
}

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

/* A body that is asked about as a whole. */
static bool is_body(const umb_selector *s, const umb_committed *scene, uint32_t occluder)
{
    const umb_occluder *o = &scene->occluders[occluder];
    return o->mesh->convex && !is_welded(o) && s->sets[s->set_of[occluder]].facet_count <= 16;
}

/* What moves by itself is not where the scene says. */
static float area_of(const umb_selector *s, const umb_committed *scene, uint32_t occluder)
{
    const umb_facets *f = &s->sets[s->set_of[occluder]];
    const umb_occluder *o = &scene->occluders[occluder];
    if (o->moves) {
        return 0.0f;
    }
    if (is_body(s, scene, occluder)) {
        float sum = 0.0f;
        for (uint32_t i = 0; i < f->facet_count; ++i) {
            sum += f->sizes[i];
        }
        return 0.5f * sum * area_scale(o);
    }
    if (is_welded(o)) {
        uint32_t first = s->soup_first[occluder];
        return first < s->soup_first[occluder + 1] ? f->sizes[first] : 0.0f;
    }
    return f->facet_count > 0 ? f->sizes[0] * area_scale(o) : 0.0f;
}

static uint32_t occluder_of(const umb_committed *scene, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    return (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? scene->objects[number].occluder : number;
}

static float slot_area(const umb_selector *s, const umb_committed *scene, uint32_t ref)
{
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        return s->node_areas[ref & UMB_REF_NUMBER];
    }
    uint32_t o = occluder_of(scene, ref);
    /* Areas are those of the scene's time; a view of another time may find that one is elsewhere. */
    return o != UMB_NONE && s->areas[o] > 0.0f && !scene->occluders[o].moves ? s->areas[o] : 0.0f;
}

/* Children come after their parents; a block's after the nodes, its children before it. */
static void sum_up_nodes(umb_selector *s, const umb_choice *c)
{
    const umb_tree *tree = c->tree;
    uint32_t all = tree->node_count + tree->block_count;
    for (uint32_t i = 0; i < all; ++i) {
        uint32_t number = i < tree->node_count ? tree->node_count - 1 - i : i;
        const umb_node *node = umb_tree_node(tree, number);
        float most = 0.0f;
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            float area = slot_area(s, c->scene, node->ref[slot]);
            most = area > most ? area : most;
        }
        s->node_areas[number] = most;
    }
}

static bool learn(umb_selector *s, const umb_choice *c)
{
    const umb_allocator *a = &s->allocator;
    const umb_committed *scene = c->scene;
    size_t n = scene->occluder_count, nodes = (size_t)c->tree->node_count + c->tree->block_count;
    if (!umb_memory_reserve(a, (void **)&s->set_of, &s->of_capacity, n, sizeof *s->set_of) ||
        !umb_memory_reserve(a, (void **)&s->soup_first, &s->first_capacity, n + 1, sizeof *s->soup_first)) {
        return false;
    }
    if (!umb_memory_reserve(a, (void **)&s->areas, &s->area_capacity, n, sizeof *s->areas) ||
        !umb_memory_reserve(a, (void **)&s->rests, &s->rest_capacity, n, sizeof *s->rests) ||
        !umb_memory_reserve(a, (void **)&s->node_areas, &s->node_capacity, nodes, sizeof *s->node_areas)) {
        return false;
    }
    if (!s->known || s->structure != scene->structure) {
        free_sets(s);
        if (!make_sets(s, scene)) {
            free_sets(s);
            return false;
        }
        share_soup(s, scene);
        memset(s->rests, 0, n * sizeof *s->rests);
    }
    for (uint32_t i = 0; i < n; ++i) {
        s->areas[i] = area_of(s, scene, i);
    }
    sum_up_nodes(s, c);
    s->structure = scene->structure;
    s->version = scene->version;
    s->known = true;
    return true;
}

/* ---- the search ------------------------------------------------------------------------------ */

/* Greater scores first; then by ref and facet, so that the order is total. */
static bool comes_before(const umb_candidate *a, const umb_candidate *b)
{
    if (a->score != b->score) {
        return a->score > b->score;
    }
    return a->ref != b->ref ? a->ref < b->ref : a->facet < b->facet;
}

static void push(umb_selector *s, umb_candidate c)
{
    if (!umb_memory_reserve(&s->allocator, (void **)&s->heap, &s->heap_capacity, s->heap_count + 1,
                            sizeof *s->heap)) {
        s->failed = true;
        return;
    }
    size_t at = s->heap_count++;
    for (; at > 0 && comes_before(&c, &s->heap[(at - 1) / 2]); at = (at - 1) / 2) {
        s->heap[at] = s->heap[(at - 1) / 2];
    }
    s->heap[at] = c;
}

static umb_candidate pop(umb_selector *s)
{
    umb_candidate top = s->heap[0], last = s->heap[--s->heap_count];
    size_t at = 0;
    for (size_t child = 1; child < s->heap_count; child = 2 * at + 1) {
        child += child + 1 < s->heap_count && comes_before(&s->heap[child + 1], &s->heap[child]);
        if (!comes_before(&s->heap[child], &last)) {
            break;
        }
        s->heap[at] = s->heap[child];
        at = child;
    }
    s->heap[at] = last;
    return top;
}

/* No candidate of this area in the box looks larger. */
static float bound_of(const umb_selector *s, const umb_node *node, uint32_t slot, float area)
{
    double square = 0.0;
    for (int i = 0; i < 3 && !s->choice->viewer.parallel; ++i) {
        double low = node->min[i][slot] - s->eye[i], high = s->eye[i] - node->max[i][slot];
        double off = low > 0.0 ? low : high > 0.0 ? high : 0.0;
        square += off * off;
    }
    if (s->choice->viewer.parallel) {
        return area;
    }
    double angle = area / square;
    return angle < FULL_ANGLE ? (float)angle : FULL_ANGLE;
}

static void open_node(umb_selector *s, uint32_t number, uint16_t planes)
{
    const umb_choice *c = s->choice;
    const umb_node *node = umb_tree_node(c->tree, number);
    uint16_t left[UMB_NODE_WIDTH] = {0};
    uint32_t in = (1u << node->count) - 1u;
    if (planes != 0) {
        in &= ~umb_frustum_test_node(c->frustum, s->kernels, node, planes, NULL, left);
    }
    for (; in != 0; in &= in - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(in), ref = node->ref[slot];
        float area = slot_area(s, c->scene, ref);
        if (!(area > 0.0f)) {
            continue;
        }
        if ((ref & UMB_REF_KIND) != UMB_REF_NODE) {
            uint32_t occluder = occluder_of(c->scene, ref);
            if (!umb_mask_takes(c->mask, c->scene->occluder_masks[occluder])) {
                continue;
            }
            ref = UMB_REF_OCCLUDER | occluder;
        }
        push(s, (umb_candidate){bound_of(s, node, slot, area), ref, UMB_NONE, left[slot], 0});
    }
}

static umb_vec3 relative(const umb_selector *s, const umb_pick *p, uint32_t vertex)
{
    float v[3];
    const float *at = p->facets->positions[vertex];
    if (p->place->identity) {
        memcpy(v, at, sizeof v);
    } else {
        umb_transform_point(&p->place->transform, at, v);
    }
    return umb_vec3_make(v[0] - s->eye[0], v[1] - s->eye[1], v[2] - s->eye[2]);
}

static umb_vec3 area_vector(const umb_vec3 *corners, uint32_t count)
{
    umb_vec3 sum = {0, 0, 0};
    for (uint32_t i = 2; i < count; ++i) {
        sum = umb_vec3_add(sum, umb_vec3_cross(umb_vec3_sub(corners[i - 1], corners[0]),
                                               umb_vec3_sub(corners[i], corners[0])));
    }
    return umb_vec3_scale(sum, 0.5);
}

static double score_corners(const umb_selector *s, const umb_vec3 *corners, uint32_t count)
{
    umb_vec3 centre = {0, 0, 0};
    for (uint32_t i = 0; i < count; ++i) {
        centre = umb_vec3_add(centre, umb_vec3_scale(corners[i], 1.0 / count));
    }
    umb_vec3 area = area_vector(corners, count);
    if (s->choice->viewer.parallel) {
        return -umb_vec3_dot(area, umb_vec3_from_double(s->choice->viewer.points[0]));
    }
    double distance = umb_vec3_length(centre), front = umb_measure_area_angle(area, centre);
    switch (s->by) {
    case UMB_SELECT_AREA_ANGLE:
        return front;
    case UMB_SELECT_UMBRA_GROWTH: {
        umb_vec3 n = umb_vec3_scale(centre, 1.0 / distance);
        double growth = umb_measure_umbra_growth(corners, count, n, 1.0);
        return growth > 1.0 && front != 0.0 ? copysign(growth - 1.0, front) : 0.0;
    }
    case UMB_SELECT_SOLID_ANGLE:
        break;
    }
    return umb_measure_solid_angle(corners, count);
}

/* Of a facet, 0 if it is seen from behind and hides nothing there. */
static double score_facet(const umb_selector *s, const umb_pick *p, uint32_t facet)
{
    const umb_facet *f = &p->facets->facets[facet];
    umb_vec3 corners[UMB_FACET_CORNERS];
    for (uint32_t i = 0; i < f->count; ++i) {
        corners[i] = relative(s, p, p->facets->corners[f->first + i]);
    }
    double score = score_corners(s, corners, f->count) * (p->place->mirrored ? -1.0 : 1.0);
    score = f->two_sided ? fabs(score) : score;
    return score > 0.0 && score < 1e30 ? score : 0.0;
}

static umb_pick pick_of(const umb_selector *s, uint32_t occluder, uint32_t facet, float score)
{
    const umb_occluder *place = &s->choice->scene->occluders[occluder];
    bool welded = is_welded(place);
    return (umb_pick){.place = place,
                      .facets = &s->sets[s->set_of[occluder]],
                      .occluder = occluder,
                      .set = welded ? UMB_NONE : occluder,
                      .facet = facet,
                      .score = score};
}

/* An occluder's own candidates, with their own scores. */
static void expand(umb_selector *s, uint32_t occluder)
{
    umb_pick p = pick_of(s, occluder, UMB_NONE, 0.0f);
    uint32_t ref = UMB_REF_OCCLUDER | occluder;
    if (s->rests[occluder].met == s->frame) {
        return;
    }
    s->rests[occluder].met = s->frame;
    if ((s->choice->coherence & UMB_COHERENCE_REST) != 0 && s->rests[occluder].until > s->frame) {
        s->choice->stats->resting += 1;
        return;
    }
    if (is_body(s, s->choice->scene, occluder)) {
        double sum = 0.0;
        for (uint32_t i = 0; i < p.facets->facet_count; ++i) {
            sum += score_facet(s, &p, i);
        }
        if (sum > 0.0) {
            push(s, (umb_candidate){(float)sum, ref, UMB_NONE, 0, 1});
        }
        return;
    }
    bool welded = p.set == UMB_NONE;
    uint32_t first = welded ? s->soup_first[occluder] : 0;
    uint32_t end = welded ? s->soup_first[occluder + 1] : p.facets->facet_count;
    end = end - first > MOST_FACETS ? first + MOST_FACETS : end;
    for (uint32_t i = first; i < end; ++i) {
        double score = score_facet(s, &p, i);
        if (score > 0.0) {
            push(s, (umb_candidate){(float)score, ref, i, 0, 1});
        }
    }
}

umb_result umb_select_begin(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels)
{
    s->choice = choice;
    s->kernels = kernels;
    s->failed = false;
    s->heap_count = 0;
    s->frame += 1;
    if ((!s->known || s->version != choice->scene->version) && !learn(s, choice)) {
        return UMB_ERROR_MEMORY;
    }
    const umb_viewer *v = &choice->viewer;
    for (int i = 0; i < 3; ++i) {
        s->eye[i] = 0.0;
        for (uint32_t k = 0; k < v->point_count && !v->parallel; ++k) {
            s->eye[i] += v->points[k][i] / v->point_count;
        }
    }
    const umb_tree *tree = choice->tree;
    if (tree->node_count > 0) {
        uint32_t top = tree->flat ? tree->node_count + tree->block_count - 1 : 0;
        push(s, (umb_candidate){FULL_ANGLE, UMB_REF_NODE | top, UMB_NONE, choice->frustum->all_planes, 0});
    }
    return s->failed ? UMB_ERROR_MEMORY : UMB_OK;
}

bool umb_select_next(umb_selector *s, umb_pick *out)
{
    while (s->heap_count > 0) {
        umb_candidate c = pop(s);
        uint32_t number = c.ref & UMB_REF_NUMBER;
        if (c.ready) {
            *out = pick_of(s, number, c.facet, c.score);
            return true;
        }
        if ((c.ref & UMB_REF_KIND) == UMB_REF_NODE) {
            open_node(s, number, c.planes);
        } else {
            expand(s, number);
        }
    }
    return false;
}

void umb_select_feedback(umb_selector *s, uint32_t occluder, uint32_t hidden)
{
    umb_rest *r = &s->rests[occluder];
    if (hidden > 0) {
        r->idle = 0;
        return;
    }
    uint32_t length = 1u << (r->idle < 3 ? r->idle : 3);
    r->idle += r->idle < 3;
    r->until = s->frame + 1 + (length < LONGEST_REST ? length : LONGEST_REST);
}
