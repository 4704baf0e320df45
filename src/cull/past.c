#include "past.h"

#include <stdlib.h>
#include <string.h>

/* Frames count from 2, so that the zeros of fresh arrays are no recent frame. */
#define FIRST_FRAME 2u

static bool reserve(umb_past *p, const umb_allocator *a, const umb_tree *tree, const umb_committed *scene)
{
    bool list = umb_past_has(p, UMB_COHERENCE_LIST);
    size_t nodes = umb_past_has(p, UMB_COHERENCE_HIERARCHY) ? tree->node_room : 0;
    size_t objects = umb_past_has(p, UMB_COHERENCE_CONSERVATIVE) ? scene->object_count : 0;
    size_t occluders = scene->occluder_count;
    return umb_memory_reserve(a, (void **)&p->open, &p->open_capacity, nodes, sizeof *p->open) &&
           umb_memory_reserve(a, (void **)&p->seen, &p->seen_capacity, objects, sizeof *p->seen) &&
           umb_memory_reserve(a, (void **)&p->occluders, &p->occluder_capacity, occluders, sizeof *p->occluders) &&
           umb_memory_reserve(a, (void **)&p->early, &p->early_capacity, list ? occluders : 0, sizeof *p->early) &&
           umb_memory_reserve(a, (void **)&p->next, &p->next_capacity, list ? occluders : 0, sizeof *p->next);
}

static void clear(void *array, size_t capacity, size_t size)
{
    if (capacity > 0) {
        memset(array, 0, capacity * size);
    }
}

static void forget(umb_past *p)
{
    clear(p->open, p->open_capacity, sizeof *p->open);
    clear(p->seen, p->seen_capacity, sizeof *p->seen);
    clear(p->occluders, p->occluder_capacity, sizeof *p->occluders);
    for (size_t i = 0; i < p->occluder_capacity; ++i) {
        p->occluders[i].worth = 255;
    }
    clear(p->places, p->place_capacity, sizeof *p->places);
    p->early_count = p->next_count = 0;
    p->least_score = 0;
    p->least_count = p->budget;
    p->frame = FIRST_FRAME;
}

static bool reserve_places(umb_past *p, const umb_allocator *a, const umb_raster_map *map)
{
    if (!umb_past_has(p, UMB_COHERENCE_PROPAGATION)) {
        return true;
    }
    size_t before = p->place_capacity;
    p->columns = (map->width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH;
    p->rows = (map->height + UMB_TILE_HEIGHT - 1) / UMB_TILE_HEIGHT;
    if (!umb_memory_reserve(a, (void **)&p->places, &p->place_capacity, (size_t)p->columns * p->rows,
                            sizeof *p->places)) {
        return false;
    }
    clear(p->places + before, p->place_capacity - before, sizeof *p->places);
    return true;
}

/* An occluder of which nothing is known. */
static const umb_occluder_past new_occluder = {.worth = 255};

/* Room for what is new, and nothing known of it. */
static bool extend(umb_past *p, const umb_allocator *a, const umb_tree *tree, const umb_committed *scene)
{
    size_t open = p->open_capacity, seen = p->seen_capacity, occluders = p->occluder_capacity;
    if (!reserve(p, a, tree, scene)) {
        return false;
    }
    clear(p->open + open, p->open_capacity - open, sizeof *p->open);
    clear(p->seen + seen, p->seen_capacity - seen, sizeof *p->seen);
    for (; occluders < p->occluder_capacity; ++occluders) {
        p->occluders[occluders] = new_occluder;
    }
    return true;
}

/* The structure has grown once since the last frame: what is told of numbers that mean another thing now is dropped.
 * Nodes need no care: one that was open before is opened untested once more. */
static void follow(umb_past *p, const umb_committed *scene)
{
    for (uint32_t i = 0; i < scene->came_count && p->seen_capacity > 0; ++i) {
        p->seen[scene->came[i]] = 0;
    }
    for (uint32_t i = 0; i < scene->replaced_count; ++i) {
        if (scene->replaced[i] < p->occluder_capacity) {
            p->occluders[scene->replaced[i]] = new_occluder;
        }
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < p->early_count; ++i) {
        uint32_t occluder = p->early[i];
        if (occluder < scene->occluder_count && p->occluders[occluder].drawn != 0) {
            p->early[kept++] = occluder;
        }
    }
    p->early_count = kept;
}

bool umb_past_begin(umb_past *p, const umb_allocator *a, const umb_tree *tree, const umb_committed *scene,
                    const umb_raster_map *map)
{
    bool known = p->frame != 0 && p->frame != UINT32_MAX, same = p->structure == scene->structure;
    if (!reserve_places(p, a, map)) {
        return false;
    }
    if (!known || (!same && p->structure + 1 != scene->structure)) {
        p->frame = 0;
        if (!reserve(p, a, tree, scene)) {
            return false;
        }
        forget(p);
    } else {
        if (!extend(p, a, tree, scene)) {
            p->frame = 0;
            return false;
        }
        if (!same) {
            follow(p, scene);
        }
    }
    p->structure = scene->structure;
    p->width = map->width;
    p->height = map->height;
    p->next_count = 0;
    p->left = p->budget;
    p->least_left = p->least_count;
    if (p->budget != 0) {
        memset(p->scores, 0, sizeof p->scores);
    }
    return true;
}

/* What score it takes in the next frame, if that is like this one: of those with the least, the walk's order decides
 * which the rest of the budget is for. */
static void choose_score(umb_past *p)
{
    uint32_t sum = 0, score = UMB_PAST_SCORES;
    while (score > 0 && sum + p->scores[score - 1] <= p->budget) {
        sum += p->scores[--score];
    }
    p->least_score = score > 0 ? score - 1 : 0;
    p->least_count = score > 0 ? p->budget - sum : p->budget;
}

void umb_past_end(umb_past *p)
{
    uint32_t *list = p->early;
    size_t capacity = p->early_capacity;
    p->early = p->next;
    p->early_capacity = p->next_capacity;
    p->early_count = p->next_count;
    p->next = list;
    p->next_capacity = capacity;
    if (p->budget != 0) {
        choose_score(p);
    }
    p->frame += 1;
}

void umb_past_free(umb_past *p, const umb_allocator *a)
{
    umb_memory_free(a, p->open, p->open_capacity * sizeof *p->open);
    umb_memory_free(a, p->seen, p->seen_capacity * sizeof *p->seen);
    umb_memory_free(a, p->occluders, p->occluder_capacity * sizeof *p->occluders);
    umb_memory_free(a, p->early, p->early_capacity * sizeof *p->early);
    umb_memory_free(a, p->next, p->next_capacity * sizeof *p->next);
    umb_memory_free(a, p->places, p->place_capacity * sizeof *p->places);
    memset(p, 0, sizeof *p);
}

static size_t place_of(const umb_past *p, const umb_image *image)
{
    uint32_t x = (uint32_t)(image->rect.x0 + image->rect.x1) / 2 / UMB_TILE_WIDTH;
    uint32_t y = (uint32_t)(image->rect.y0 + image->rect.y1) / 2 / UMB_TILE_HEIGHT;
    return (size_t)y * p->columns + x;
}

bool umb_past_hides(const umb_past *p, const umb_image *image)
{
    const umb_hidden_place *h = &p->places[place_of(p, image)];
    const umb_pixel_rect *out = &h->image.rect, *in = &image->rect;
    return h->frame == p->frame && h->image.nearness >= image->nearness && out->x0 <= in->x0 &&
           out->y0 <= in->y0 && out->x1 >= in->x1 && out->y1 >= in->y1;
}

void umb_past_hidden(umb_past *p, const umb_image *image)
{
    umb_hidden_place *h = &p->places[place_of(p, image)];
    h->image = *image;
    h->frame = p->frame;
}

/* A number that grows with the logarithm of pixels times worth, four steps an octave. */
static uint32_t score_of(const umb_occluder_past *o, uint32_t pixels)
{
    uint64_t product = (uint64_t)pixels * (1u + o->worth) + 8;
    uint32_t top = 63u - (uint32_t)__builtin_clzll(product);
    return 4 * top + (uint32_t)(product >> (top - 2) & 3u);
}

/* An image that has gone far, or that has grown or shrunk, is of another view. */
static bool much_the_same(const umb_past *p, const umb_pixel_rect *a, const umb_pixel_rect *b)
{
    int32_t width = a->x1 - a->x0 + 1, height = a->y1 - a->y0 + 1;
    int32_t wider = abs(b->x1 - b->x0 + 1 - width), higher = abs(b->y1 - b->y0 + 1 - height);
    int32_t gone = abs(b->x0 - a->x0) + abs(b->y0 - a->y0);
    return wider <= 2 + width / 4 && higher <= 2 + height / 4 && gone <= (int32_t)p->width / 16;
}

umb_past_verdict umb_past_judge(umb_past *p, uint32_t occluder, const umb_pixel_rect *rect)
{
    const umb_occluder_past *o = &p->occluders[occluder];
    if (o->drawn == p->frame) {
        return UMB_PAST_DONE;
    }
    if (umb_past_has(p, UMB_COHERENCE_REST) && o->rests > p->frame &&
        (rect == NULL ? o->rect.x0 > o->rect.x1 : much_the_same(p, &o->rect, rect))) {
        return UMB_PAST_RESTS;
    }
    if (p->budget != 0) {
        uint32_t score = score_of(o, rect == NULL ? p->width * p->height
                                                  : (uint32_t)(rect->x1 - rect->x0 + 1) *
                                                        (uint32_t)(rect->y1 - rect->y0 + 1));
        p->scores[score] += 1;
        if (p->left == 0 || score < p->least_score || (score == p->least_score && p->least_left == 0)) {
            return UMB_PAST_COSTS;
        }
        p->left -= 1;
        p->was_least = score == p->least_score;
        p->least_left -= p->was_least;
    }
    return UMB_PAST_DRAW;
}

static uint32_t tiles_of(const umb_past *p, const umb_pixel_rect *r)
{
    uint32_t x0 = 0, y0 = 0, x1 = p->width - 1, y1 = p->height - 1;
    if (r != NULL) {
        x0 = (uint32_t)r->x0;
        y0 = (uint32_t)r->y0;
        x1 = (uint32_t)r->x1;
        y1 = (uint32_t)r->y1;
    }
    return (x1 / UMB_TILE_WIDTH - x0 / UMB_TILE_WIDTH + 1) * (y1 / UMB_TILE_HEIGHT - y0 / UMB_TILE_HEIGHT + 1);
}

void umb_past_drew(umb_past *p, uint32_t occluder, const umb_pixel_rect *rect, uint32_t tiles, bool costly)
{
    umb_occluder_past *o = &p->occluders[occluder];
    uint32_t share = 255 * tiles / tiles_of(p, rect);
    o->drawn = p->frame;
    o->rect = rect != NULL ? *rect : (umb_pixel_rect){1, 1, 0, 0};
    o->worth = (uint8_t)((o->worth + (share < 255 ? share : 255)) / 2);
    if (tiles != 0) {
        o->idle = 0;
        if (umb_past_has(p, UMB_COHERENCE_LIST)) {
            p->next[p->next_count++] = occluder;
        }
    } else if (costly) {
        /* Nothing tells whether one at the eye is still the same sight: it is looked at every other frame. */
        o->rests = p->frame + 1 + (rect != NULL ? 1u << o->idle : 1u);
        o->idle = (uint8_t)(o->idle < UMB_PAST_LONGEST_REST ? o->idle + 1 : o->idle);
    }
}

void umb_past_refund(umb_past *p)
{
    if (p->budget != 0) {
        p->left += 1;
        p->least_left += p->was_least;
    }
}
