#include "leaf_lists.h"

#include <math.h>
#include <string.h>

#include "geometry/transform.h"

/* Places that a split looks at. */
#define SAMPLES 63
/* The least part of how large it looks that an occluder counts for aside. */
#define LEAST_AHEAD 0.2
/* Occluders that are looked at from one point. */
#define LOOKS 768
/* Places of occluders that a leaf has, about. */
#define PLACES_EACH 24
/* Of one occluder so many facets count as places. */
#define FACETS_EACH 64
/* More changes than this in one commit are not looked at one by one. */
#define MOST_CHANGES 256
/* Commits with moves after which a leaf looks again. */
#define MOST_MOVES 64

/* Direction k of the 26: towards the faces, edges and corners of a cube. */
static umb_vec3 direction_of(uint32_t k)
{
    uint32_t code = k < 13 ? k : k + 1; /* without 0, 0, 0 */
    umb_vec3 v = umb_vec3_make((int)(code % 3) - 1, (int)(code / 3 % 3) - 1, (int)(code / 9) - 1);
    return umb_vec3_scale(v, 1.0 / umb_vec3_length(v));
}

void umb_leaf_lists_create(umb_leaf_lists *l, const umb_allocator *a)
{
    memset(l, 0, sizeof *l);
    l->allocator = *a;
    l->wanted = UMB_NONE;
    for (uint32_t k = 0; k < UMB_LEAF_DIRECTIONS; ++k) {
        l->directions[k] = direction_of(k);
    }
}

static size_t entry_count(const umb_leaf_lists *l)
{
    return (size_t)2 * UMB_LEAF_DIRECTIONS * l->length;
}

static void free_arrays(umb_leaf_lists *l, uint32_t count)
{
    const umb_allocator *a = &l->allocator;
    umb_memory_free(a, l->leaves, count * sizeof *l->leaves);
    umb_memory_free(a, l->at, count * sizeof *l->at);
    umb_memory_free(a, l->axes, count);
    l->leaves = NULL;
    l->at = NULL;
    l->axes = NULL;
}

static void free_tree(umb_leaf_lists *l)
{
    uint32_t count = l->leaves != NULL ? 1u << l->depth : 0;
    for (uint32_t i = 0; i < count; ++i) {
        umb_memory_free(&l->allocator, l->leaves[i].entries, entry_count(l) * sizeof *l->leaves[i].entries);
    }
    free_arrays(l, count);
    l->made = false;
    l->wanted = UMB_NONE;
}

void umb_leaf_lists_free(umb_leaf_lists *l)
{
    free_tree(l);
    umb_memory_free(&l->allocator, l->places, l->place_capacity * sizeof *l->places);
    memset(l, 0, sizeof *l);
}

/* ---- the tree ----------------------------------------------------------------------------------- */

static uint32_t facets_from(const umb_selector *s, uint32_t occluder, uint32_t *first)
{
    const umb_occluder_sets *k = &s->known;
    bool welded = k->set_of[occluder] == UMB_SET_WELDED;
    *first = welded ? k->soup_first[occluder] : 0;
    uint32_t end = welded ? k->soup_first[occluder + 1] : k->sets[k->set_of[occluder]].facets.facet_count;
    uint32_t count = end - *first;
    return count < FACETS_EACH ? count : FACETS_EACH;
}

/* Where occluders are: the middle of each body, of each facet of others. */
static bool find_places(umb_leaf_lists *l, const umb_selector *s, const umb_committed *scene, uint32_t *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < scene->occluder_count; ++i) {
        const umb_occluder *o = &scene->occluders[i];
        uint32_t first, count = facets_from(s, i, &first);
        bool body = umb_occluder_is_body(&s->known, scene, i);
        const umb_facets *f = &s->known.sets[s->known.set_of[i]].facets;
        if (!umb_memory_reserve(&l->allocator, (void **)&l->places, &l->place_capacity, (size_t)n + count + 1,
                                sizeof *l->places)) {
            return false;
        }
        for (int k = 0; k < 3 && body; ++k) {
            l->places[n][k] = (float)(0.5 * ((double)o->bounds.min[k] + o->bounds.max[k]));
        }
        for (uint32_t k = 0; k < count && !body; ++k) {
            const float *centre = f->facets[first + k].centre;
            memcpy(l->places[n + k], centre, sizeof l->places[0]);
            if (!o->identity) {
                umb_transform_point(&o->transform, centre, l->places[n + k]);
            }
        }
        n += body ? 1 : count;
    }
    *out = n;
    return true;
}

static void swap_places(float (*p)[3], uint32_t a, uint32_t b)
{
    float t[3];
    memcpy(t, p[a], sizeof t);
    memcpy(p[a], p[b], sizeof t);
    memcpy(p[b], t, sizeof t);
}

/* The middle one of some of the places, along an axis. */
static float middle_of(float (*places)[3], uint32_t count, int axis)
{
    float sorted[SAMPLES];
    uint32_t n = count < SAMPLES ? count : SAMPLES;
    for (uint32_t i = 0; i < n; ++i) {
        float value = places[(uint64_t)i * count / n][axis];
        uint32_t at = i;
        for (; at > 0 && sorted[at - 1] > value; --at) {
            sorted[at] = sorted[at - 1];
        }
        sorted[at] = value;
    }
    return sorted[n / 2];
}

/* Split along the longest side, at the middle of the places or not far from the middle of the side. */
static void divide(umb_leaf_lists *l, uint32_t number, umb_aabb cell, float (*places)[3], uint32_t count)
{
    uint32_t inner = (1u << l->depth) - 1, below = 0;
    if (number >= inner) {
        l->leaves[number - inner].cell = cell;
        return;
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
        axis = cell.max[k] - cell.min[k] > cell.max[axis] - cell.min[axis] ? k : axis;
    }
    float size = cell.max[axis] - cell.min[axis], lower = cell.min[axis] + 0.25f * size, upper = cell.max[axis] - 0.25f * size;
    float middle = count > 0 ? middle_of(places, count, axis) : 0.5f * (lower + upper);
    float at = middle < lower ? lower : middle > upper ? upper : middle;
    for (uint32_t i = 0; i < count; ++i) {
        if (places[i][axis] < at) {
            swap_places(places, i, below++);
        }
    }
    umb_aabb low = cell, high = cell;
    low.max[axis] = high.min[axis] = at;
    l->at[number] = at;
    l->axes[number] = (uint8_t)axis;
    divide(l, 2 * number + 1, low, places, below);
    divide(l, 2 * number + 2, high, places + below, count - below);
}

static bool make_tree(umb_leaf_lists *l, const umb_selector *s, const umb_choice *choice, uint32_t length)
{
    const umb_allocator *a = &l->allocator;
    uint32_t places;
    free_tree(l);
    if (!find_places(l, s, choice->scene, &places)) {
        return false;
    }
    l->length = length;
    l->depth = 0;
    while (l->depth < UMB_LEAF_DEPTH && places >> l->depth > PLACES_EACH) {
        l->depth += 1;
    }
    uint32_t count = 1u << l->depth;
    l->leaves = umb_memory_allocate_zero(a, count, sizeof *l->leaves);
    l->at = umb_memory_allocate_zero(a, count, sizeof *l->at);
    l->axes = umb_memory_allocate_zero(a, count, 1);
    if (l->leaves == NULL || l->at == NULL || l->axes == NULL) {
        free_arrays(l, count);
        return false;
    }
    l->bounds = choice->tree->bounds;
    divide(l, 0, l->bounds, l->places, places);
    l->made_for = choice->scene->occluder_count;
    l->made = true;
    return true;
}

uint32_t umb_leaf_lists_at(const umb_leaf_lists *l, const double place[3])
{
    bool in = l->made;
    for (int k = 0; k < 3; ++k) {
        in = in && place[k] >= l->bounds.min[k] && place[k] <= l->bounds.max[k];
    }
    uint32_t number = 0, inner = in ? (1u << l->depth) - 1 : 0;
    while (number < inner) {
        number = 2 * number + 1 + (place[l->axes[number]] >= l->at[number]);
    }
    return in ? number - inner : UMB_NONE;
}

/* ---- following the scene ------------------------------------------------------------------------ */

static void forget_all(umb_leaf_lists *l)
{
    for (uint32_t i = 0; i < 1u << l->depth; ++i) {
        l->leaves[i].points = 0;
        memset(l->leaves[i].counts, 0, sizeof l->leaves[i].counts);
    }
}

/* Whoever has a number that another occluder has now is taken out. */
static void drop_replaced(umb_leaf_lists *l, umb_leaf *leaf, const umb_committed *scene)
{
    for (uint32_t k = 0; k < 2 * UMB_LEAF_DIRECTIONS; ++k) {
        umb_leaf_entry *list = leaf->entries + (size_t)k * l->length;
        uint16_t *count = &leaf->counts[k / UMB_LEAF_DIRECTIONS][k % UMB_LEAF_DIRECTIONS], left = 0;
        for (uint32_t i = 0; i < *count; ++i) {
            bool stays = true;
            for (uint32_t r = 0; r < scene->replaced_count; ++r) {
                stays = stays && scene->replaced[r] != list[i].occluder;
            }
            if (stays) {
                list[left++] = list[i];
            }
        }
        *count = left;
    }
}

/* An occluder has come or moved: leaves from which it may be among the largest look again. */
static void meet(umb_leaf_lists *l, const umb_selector *s, const umb_committed *scene, uint32_t occluder)
{
    const umb_aabb *box = &scene->occluders[occluder].bounds;
    for (uint32_t i = 0; i < 1u << l->depth; ++i) {
        umb_leaf *leaf = &l->leaves[i];
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            double low = (double)leaf->cell.min[k] - box->max[k], high = (double)box->min[k] - leaf->cell.max[k];
            double off = low > 0.0 ? low : high > 0.0 ? high : 0.0;
            square += off * off;
        }
        if (leaf->points > 0 && s->known.areas[occluder] >= leaf->least * square) {
            leaf->points = 0;
        }
    }
}

static void follow_lists(umb_leaf_lists *l, const umb_selector *s, const umb_committed *scene, bool grew)
{
    bool moves = false;
    for (uint32_t i = 0; i < 1u << l->depth && grew; ++i) {
        if (l->leaves[i].entries != NULL) {
            drop_replaced(l, &l->leaves[i], scene);
        }
    }
    for (uint32_t i = 0; i < scene->replaced_count && grew; ++i) {
        if (scene->replaced[i] < scene->occluder_count) {
            meet(l, s, scene, scene->replaced[i]);
        }
    }
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        uint32_t occluder = scene->objects[scene->moved[i]].occluder;
        if (occluder != UMB_NONE) {
            meet(l, s, scene, occluder);
            moves = true;
        }
    }
    for (uint32_t i = 0; i < 1u << l->depth && moves; ++i) {
        umb_leaf *leaf = &l->leaves[i];
        leaf->moves = leaf->moves < MOST_MOVES ? (uint8_t)(leaf->moves + 1) : 0;
        leaf->points = leaf->moves == 0 ? 0 : leaf->points;
    }
}

bool umb_leaf_lists_follow(umb_leaf_lists *l, const umb_selector *s, const umb_choice *choice, uint32_t length)
{
    const umb_committed *scene = choice->scene;
    bool known = l->made && l->length == length && scene->occluder_count <= 2 * l->made_for + 64 &&
                 l->made_for <= 2 * scene->occluder_count + 64;
    bool grew = l->structure != scene->structure;
    uint32_t changes = scene->moved_count + (grew ? scene->replaced_count : 0);
    if (!known) {
        if (!make_tree(l, s, choice, length)) {
            return false;
        }
    } else if (l->version != scene->version) {
        bool lists = l->version + 1 == scene->version && (!grew || l->structure + 1 == scene->structure);
        if (lists && changes <= MOST_CHANGES && l->welds == s->known.welds) {
            follow_lists(l, s, scene, grew);
        } else {
            forget_all(l);
        }
    }
    l->structure = scene->structure;
    l->version = scene->version;
    l->welds = s->known.welds;
    return true;
}

/* ---- looking ------------------------------------------------------------------------------------ */

static uint32_t nearest_direction(const umb_leaf_lists *l, const double d[3])
{
    uint32_t best = 0;
    double most = -INFINITY;
    for (uint32_t k = 0; k < UMB_LEAF_DIRECTIONS; ++k) {
        double along = umb_vec3_dot(l->directions[k], umb_vec3_from_double(d));
        best = along > most ? k : best;
        most = along > most ? along : most;
    }
    return best;
}

/* In its place by score; an occluder that is there already has the greater one of both. */
static void enter(umb_leaf_entry *list, uint16_t *count, uint32_t length, umb_leaf_entry e)
{
    uint32_t at = *count;
    if (at == length && !(e.score > list[at - 1].score)) {
        return;
    }
    for (uint32_t i = 0; i < *count; ++i) {
        if (list[i].occluder == e.occluder && list[i].facet == e.facet) {
            at = i;
            break;
        }
    }
    if (at < *count && !(e.score > list[at].score)) {
        return;
    }
    if (at == *count) {
        *count = (uint16_t)(at < length ? at + 1 : length);
        at = *count - 1u;
    }
    for (; at > 0 && list[at - 1].score < e.score; --at) {
        list[at] = list[at - 1];
    }
    list[at] = e;
}

/* What it shows of its front where it stands. */
static double shown_there(const umb_select_look *look, umb_vec3 towards)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < look->count; ++i) {
        double along = umb_vec3_dot(look->areas[i], towards);
        sum += along < 0.0 || look->two_sided ? fabs(along) : 0.0;
    }
    return sum;
}

/* What it covers along v, seen from there. */
static double shown_behind(const umb_select_look *look, umb_vec3 v)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < look->count; ++i) {
        double along = umb_vec3_dot(look->areas[i], v);
        sum += along > 0.0 || look->two_sided ? fabs(along) : 0.0;
    }
    return sum;
}

static void enter_everywhere(umb_leaf_lists *l, umb_leaf *leaf, const umb_selector *s, const umb_pick *pick)
{
    umb_select_look look;
    umb_select_faces(s, pick, &look);
    double square = umb_vec3_dot(look.centre, look.centre), sum = 0.0;
    for (uint32_t i = 0; i < look.count; ++i) {
        sum += umb_vec3_length(look.areas[i]);
    }
    square = square > 1e-30 ? square : 1e-30;
    umb_vec3 towards = umb_vec3_scale(look.centre, 1.0 / sqrt(square));
    double there = shown_there(&look, towards);
    for (uint32_t k = 0; k < UMB_LEAF_DIRECTIONS; ++k) {
        umb_vec3 v = l->directions[k];
        double ahead = umb_vec3_dot(towards, v);
        if (!(ahead > 0.0) && square > sum) {
            continue; /* behind, and not all about */
        }
        /* Less the farther aside: what stands along v, as walls of a corridor do, is seen all the same. */
        const double shown[2] = {there * fmax(ahead, LEAST_AHEAD), shown_behind(&look, v)};
        for (uint32_t side = 0; side < 2; ++side) {
            float score = (float)(shown[side] / square);
            if (score > 0.0f) {
                enter(leaf->entries + (size_t)(side * UMB_LEAF_DIRECTIONS + k) * l->length, &leaf->counts[side][k],
                      l->length, (umb_leaf_entry){score, pick->occluder, pick->facet});
            }
        }
    }
}

static void point_of(const umb_leaf *leaf, uint32_t number, double out[3])
{
    for (int k = 0; k < 3; ++k) {
        double part = number == 0 ? 0.5 : (number - 1) >> k & 1 ? 0.75 : 0.25;
        out[k] = leaf->cell.min[k] + part * ((double)leaf->cell.max[k] - leaf->cell.min[k]);
    }
}

bool umb_leaf_lists_look(umb_leaf_lists *l, uint32_t number, umb_selector *s, const umb_choice *choice,
                         const umb_box_kernels *kernels)
{
    umb_leaf *leaf = &l->leaves[number];
    double eye[3];
    if (leaf->points == UMB_LEAF_POINTS) {
        return true;
    }
    if (leaf->entries == NULL) {
        leaf->entries = umb_memory_allocate_zero(&l->allocator, entry_count(l), sizeof *leaf->entries);
        if (leaf->entries == NULL) {
            return false;
        }
    }
    if (leaf->points == 0) {
        memset(leaf->counts, 0, sizeof leaf->counts);
        leaf->moves = 0;
        leaf->least = INFINITY;
    }
    point_of(leaf, leaf->points, eye);
    umb_pick pick = {.score = 0.0f};
    uint32_t count = 0;
    if (umb_select_from(s, choice, kernels, eye) != UMB_OK) {
        return false;
    }
    for (; count < LOOKS && umb_select_next(s, &pick); ++count) {
        enter_everywhere(l, leaf, s, &pick);
    }
    float least = count == LOOKS ? pick.score : 0.0f;
    leaf->least = least < leaf->least ? least : leaf->least;
    leaf->points += 1;
    return !s->failed;
}

const umb_leaf_entry *umb_leaf_lists_get(const umb_leaf_lists *l, uint32_t number, umb_leaf_side side,
                                         const double direction[3], uint32_t *count)
{
    const umb_leaf *leaf = &l->leaves[number];
    uint32_t k = nearest_direction(l, direction);
    *count = leaf->entries != NULL ? leaf->counts[side][k] : 0;
    return leaf->entries != NULL ? leaf->entries + (size_t)(side * UMB_LEAF_DIRECTIONS + k) * l->length : NULL;
}
