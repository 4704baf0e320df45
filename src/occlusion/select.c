#include "select.h"

#include <string.h>

#include "geometry/transform.h"
#include "measure.h"

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
    umb_occluder_sets_create(&s->known, a);
}

void umb_selector_free(umb_selector *s)
{
    umb_allocator a = s->known.allocator;
    umb_occluder_sets_free(&s->known);
    umb_memory_free(&a, s->rests, s->rest_capacity * sizeof *s->rests);
    umb_memory_free(&a, s->heap, s->heap_capacity * sizeof *s->heap);
    memset(s, 0, sizeof *s);
}

/* Nobody rests of those that are new. */
static bool follow_rests(umb_selector *s, const umb_committed *scene)
{
    size_t n = scene->occluder_count, old = s->rest_capacity;
    if (!umb_memory_reserve(&s->known.allocator, (void **)&s->rests, &s->rest_capacity, n, sizeof *s->rests)) {
        return false;
    }
    if (s->rest_capacity > old) {
        memset(s->rests + old, 0, (s->rest_capacity - old) * sizeof *s->rests);
    }
    if (s->rest_structure + 1 == scene->structure) {
        for (uint32_t i = 0; i < scene->replaced_count; ++i) {
            uint32_t number = scene->replaced[i];
            if (number < s->rest_capacity) {
                s->rests[number] = (umb_rest){0, 0, 0};
            }
        }
    } else if (s->rest_structure != scene->structure && n > 0) {
        memset(s->rests, 0, n * sizeof *s->rests);
    }
    s->rest_structure = scene->structure;
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
    if (!umb_memory_reserve(&s->known.allocator, (void **)&s->heap, &s->heap_capacity, s->heap_count + 1,
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

/* What moves by itself is not where the scene says. */
static float slot_area(const umb_selector *s, const umb_committed *scene, uint32_t ref)
{
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        return s->known.node_areas[ref & UMB_REF_NUMBER];
    }
    uint32_t o = umb_occluder_of(scene, ref);
    return o != UMB_NONE && !scene->occluders[o].moves ? s->known.areas[o] : 0.0f;
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
            uint32_t occluder = umb_occluder_of(c->scene, ref);
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
    switch (s->both_sides ? UMB_SELECT_AREA_ANGLE : s->by) {
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
    score = f->two_sided || s->both_sides ? fabs(score) : score;
    return score > 0.0 && score < 1e30 ? score : 0.0;
}

umb_pick umb_select_pick(const umb_selector *s, const umb_committed *scene, uint32_t occluder, uint32_t facet, float score)
{
    bool welded = s->known.set_of[occluder] == UMB_SET_WELDED;
    return (umb_pick){.place = &scene->occluders[occluder],
                      .facets = &s->known.sets[s->known.set_of[occluder]].facets,
                      .occluder = occluder,
                      .set = welded ? UMB_NONE : occluder,
                      .facet = facet,
                      .score = score};
}

void umb_select_faces(const umb_selector *s, const umb_pick *pick, umb_select_look *out)
{
    bool body = pick->facet == UMB_NONE;
    uint32_t first = body ? 0 : pick->facet, end = body ? pick->facets->facet_count : pick->facet + 1, corners_in_all = 0;
    *out = (umb_select_look){.two_sided = !body && pick->facets->facets[pick->facet].two_sided};
    for (uint32_t i = first; i < end && out->count < UMB_SELECT_FACES; ++i) {
        const umb_facet *f = &pick->facets->facets[i];
        umb_vec3 corners[UMB_FACET_CORNERS];
        for (uint32_t k = 0; k < f->count; ++k) {
            corners[k] = relative(s, pick, pick->facets->corners[f->first + k]);
            out->centre = umb_vec3_add(out->centre, corners[k]);
        }
        corners_in_all += f->count;
        out->areas[out->count++] = umb_vec3_scale(area_vector(corners, f->count), pick->place->mirrored ? -1.0 : 1.0);
    }
    out->centre = umb_vec3_scale(out->centre, corners_in_all > 0 ? 1.0 / corners_in_all : 0.0);
}

bool umb_select_rests(const umb_selector *s, uint32_t occluder)
{
    return s->rests[occluder].until > s->frame;
}

float umb_select_score(const umb_selector *s, const umb_pick *pick)
{
    bool body = pick->facet == UMB_NONE;
    uint32_t first = body ? 0 : pick->facet, end = body ? pick->facets->facet_count : pick->facet + 1;
    double sum = 0.0;
    for (uint32_t i = first; i < end; ++i) {
        sum += score_facet(s, pick, i);
    }
    return (float)sum;
}

/* An occluder's own candidates, with their own scores. */
static void expand(umb_selector *s, uint32_t occluder)
{
    umb_pick p = umb_select_pick(s, s->choice->scene, occluder, UMB_NONE, 0.0f);
    uint32_t ref = UMB_REF_OCCLUDER | occluder;
    if (s->rests[occluder].met == s->searches) {
        return;
    }
    s->rests[occluder].met = s->searches;
    if ((s->choice->coherence & UMB_COHERENCE_REST) != 0 && umb_select_rests(s, occluder)) {
        s->choice->stats->resting += 1;
        return;
    }
    if (umb_occluder_is_body(&s->known, s->choice->scene, occluder)) {
        float score = umb_select_score(s, &p);
        if (score > 0.0f) {
            push(s, (umb_candidate){score, ref, UMB_NONE, 0, 1});
        }
        return;
    }
    bool welded = p.set == UMB_NONE;
    uint32_t first = welded ? s->known.soup_first[occluder] : 0;
    uint32_t end = welded ? s->known.soup_first[occluder + 1] : p.facets->facet_count;
    end = end - first > MOST_FACETS ? first + MOST_FACETS : end;
    for (uint32_t i = first; i < end; ++i) {
        double score = score_facet(s, &p, i);
        if (score > 0.0) {
            push(s, (umb_candidate){(float)score, ref, i, 0, 1});
        }
    }
}

bool umb_select_follow(umb_selector *s, const umb_choice *choice)
{
    s->frame += 1;
    s->failed = false;
    return umb_occluder_sets_follow(&s->known, choice) && follow_rests(s, choice->scene);
}

/* At the root. planes: of the frustum that is to be kept to. */
static umb_result start(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels, uint16_t planes)
{
    const umb_tree *tree = choice->tree;
    s->choice = choice;
    s->kernels = kernels;
    s->failed = false;
    s->heap_count = 0;
    s->searches += 1;
    if (tree->node_count > 0) {
        uint32_t top = tree->flat ? tree->node_count + tree->block_count - 1 : 0;
        push(s, (umb_candidate){FULL_ANGLE, UMB_REF_NODE | top, UMB_NONE, planes, 0});
    }
    return s->failed ? UMB_ERROR_MEMORY : UMB_OK;
}

void umb_select_look_from(umb_selector *s, const umb_choice *choice)
{
    const umb_viewer *v = &choice->viewer;
    for (int i = 0; i < 3; ++i) {
        s->eye[i] = 0.0;
        for (uint32_t k = 0; k < v->point_count && !v->parallel; ++k) {
            s->eye[i] += v->points[k][i] / v->point_count;
        }
    }
    s->choice = choice;
    s->both_sides = false;
}

umb_result umb_select_begin(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels)
{
    umb_select_look_from(s, choice);
    return start(s, choice, kernels, choice->frustum->all_planes);
}

umb_result umb_select_from(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels, const double eye[3])
{
    memcpy(s->eye, eye, sizeof s->eye);
    s->all = *choice;
    s->all.mask = (umb_mask){0};
    s->all.coherence = 0;
    s->all.viewer.parallel = false;
    s->both_sides = true;
    return start(s, &s->all, kernels, 0);
}

bool umb_select_next(umb_selector *s, umb_pick *out)
{
    while (s->heap_count > 0) {
        umb_candidate c = pop(s);
        uint32_t number = c.ref & UMB_REF_NUMBER;
        if (c.ready) {
            *out = umb_select_pick(s, s->choice->scene, number, c.facet, c.score);
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
