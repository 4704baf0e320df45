#include "ahead.h"

#include "base/memory.h"

/* Guesses of a frame. */
#define MOST_IMAGES 4096u

/* Tiles of lists that a helper has room for, for each tile of the raster. */
#define LAYERS 24u

/* Work is counted in vertices placed; an edge of the outline is worth this many. Occluders of less work than
 * LEAST_IMAGE are drawn faster than they are handed over, and frames of less than LEAST_FRAME are over before
 * another thread has woken up. */
#define EDGE_WORK 16u
#define LEAST_IMAGE 64u
#define LEAST_FRAME 4096u

/* Helpers begin this part of what is left ahead of the walk: it draws that itself meanwhile, and finds ready what
 * comes then. Nearer they would be overtaken, farther they would run out of work before it ends. */
#define LEAD 4u

/* How often the walk looks at an image that is being found before it finds it itself: some 20 us. */
#define MOST_LOOKS 512u

void umb_ahead_free(umb_ahead *a, const umb_allocator *allocator)
{
    for (uint32_t i = 0; i < UMB_AHEAD_HELPERS; ++i) {
        umb_ahead_helper *h = &a->helpers[i];
        umb_mesh_scratch_free(&h->scratch, allocator);
        umb_memory_free(allocator, h->tiles, h->tile_capacity * sizeof *h->tiles);
        umb_memory_free(allocator, h->numbers, h->number_capacity * sizeof *h->numbers);
    }
    umb_memory_free(allocator, a->images, a->image_capacity * sizeof *a->images);
    umb_memory_free(allocator, a->place, a->place_capacity * sizeof *a->place);
    umb_memory_free(allocator, a->noted, a->noted_capacity * sizeof *a->noted);
}

/* For every frame on this raster and scene, whatever it draws. */
static bool reserve(umb_ahead *a, const umb_allocator *allocator, uint32_t helpers)
{
    size_t columns = (a->map->width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH;
    size_t rows = (a->map->height + UMB_TILE_HEIGHT - 1) / UMB_TILE_HEIGHT;
    size_t tiles = LAYERS * columns * rows;
    if (!umb_memory_reserve(allocator, (void **)&a->images, &a->image_capacity, MOST_IMAGES, sizeof *a->images) ||
        !umb_memory_reserve(allocator, (void **)&a->noted, &a->noted_capacity, MOST_IMAGES, sizeof *a->noted) ||
        !umb_memory_reserve_zero(allocator, (void **)&a->place, &a->place_capacity, a->scene->occluder_count,
                                 sizeof *a->place)) {
        return false;
    }
    for (uint32_t i = 0; i < helpers; ++i) {
        umb_ahead_helper *h = &a->helpers[i];
        h->used = 0;
        if (!umb_mesh_scratch_reserve(&h->scratch, allocator, a->map, a->scene) ||
            !umb_memory_reserve(allocator, (void **)&h->tiles, &h->tile_capacity, tiles, sizeof *h->tiles) ||
            !umb_memory_reserve(allocator, (void **)&h->numbers, &h->number_capacity, tiles, sizeof *h->numbers)) {
            return false;
        }
    }
    return true;
}

static umb_ahead_image *find(umb_ahead *a, uint32_t occluder)
{
    uint32_t at = a->place[occluder];
    return at < a->image_count && a->images[at].occluder == occluder ? &a->images[at] : NULL;
}

/* Numbers of occluders may mean others since: then the images of those are found, in vain. */
static void guess(umb_ahead *a)
{
    a->image_count = 0;
    for (uint32_t i = 0; i < a->noted_count; ++i) {
        uint32_t occluder = a->noted[i];
        if (occluder < a->scene->occluder_count && !a->scene->occluders[occluder].moves && find(a, occluder) == NULL) {
            a->place[occluder] = a->image_count;
            umb_ahead_image *image = &a->images[a->image_count++];
            image->occluder = occluder;
            atomic_store_explicit(&image->state, UMB_AHEAD_FREE, memory_order_relaxed);
        }
    }
    atomic_store_explicit(&a->next, 0, memory_order_relaxed);
    atomic_store_explicit(&a->walk, 0, memory_order_relaxed);
    atomic_store_explicit(&a->done, false, memory_order_relaxed);
}

uint32_t umb_ahead_begin(umb_ahead *a, const umb_allocator *allocator, const umb_raster_kernels *kernels,
                         const umb_raster_map *map, const umb_committed *scene, uint32_t workers)
{
    uint32_t helpers = workers > UMB_AHEAD_HELPERS ? UMB_AHEAD_HELPERS : workers > 1 ? workers - 1 : 0;
    a->kernels = kernels;
    a->map = map;
    a->scene = scene;
    a->image_count = 0;
    a->on = helpers > 0 && reserve(a, allocator, helpers);
    a->helper_count = 0;
    if (a->on && a->noted_work >= LEAST_FRAME) {
        guess(a);
        a->helper_count = helpers < a->image_count ? helpers : a->image_count;
    }
    a->noted_count = 0;
    a->noted_work = 0;
    return a->helper_count;
}

/* True if nobody has come before. */
static bool claim(umb_ahead_image *image, uint32_t state)
{
    uint32_t expected = UMB_AHEAD_FREE;
    return atomic_compare_exchange_strong_explicit(&image->state, &expected, state, memory_order_relaxed,
                                                   memory_order_relaxed);
}

static void find_image(const umb_ahead *a, umb_ahead_helper *h, umb_ahead_image *image)
{
    const umb_occluder *o = &a->scene->occluders[image->occluder];
    umb_silhouette *s = &h->scratch.silhouette;
    a->kernels->approach(s, a->map, o);
    a->kernels->place(s, a->map);
    image->drawn = umb_mesh_image_find(&h->scratch, a->map, o);
    image->list = (umb_tile_list){.tiles = h->tiles + h->used,
                                  .numbers = h->numbers + h->used,
                                  .capacity = (uint32_t)(h->tile_capacity - h->used)};
    if (image->drawn) {
        image->edge_count = s->edge_count;
        umb_mesh_image_list(&h->scratch, a->map, o);
        if (!a->kernels->list_mesh(&image->list, a->map, s, &h->scratch.fill)) {
            atomic_store_explicit(&image->state, UMB_AHEAD_LEFT, memory_order_relaxed);
            return;
        }
        h->used += image->list.count;
    }
    atomic_store_explicit(&image->state, UMB_AHEAD_READY, memory_order_release);
}

static bool is_over(umb_ahead *a)
{
    return atomic_load_explicit(&a->done, memory_order_relaxed);
}

static void find_if_free(umb_ahead *a, uint32_t helper, uint32_t i)
{
    if (claim(&a->images[i], UMB_AHEAD_TAKEN)) {
        find_image(a, &a->helpers[helper], &a->images[i]);
    }
}

/* The next guess, or one farther on if the walk has overtaken it. */
static uint32_t next_image(umb_ahead *a)
{
    uint32_t next = atomic_load_explicit(&a->next, memory_order_relaxed), i;
    do {
        uint32_t walk = atomic_load_explicit(&a->walk, memory_order_relaxed);
        uint32_t left = a->image_count - walk;
        i = next > walk ? next : walk + 1 + left / (LEAD * a->helper_count);
    } while (!atomic_compare_exchange_weak_explicit(&a->next, &next, i + 1, memory_order_relaxed,
                                                    memory_order_relaxed));
    return i;
}

/* Forwards from ahead of the walk; then, for the walk does not keep quite to the last one's order, backwards
 * through what that left. */
void umb_ahead_help(umb_ahead *a, uint32_t helper)
{
    uint32_t i = next_image(a);
    for (; i < a->image_count && !is_over(a); i = next_image(a)) {
        find_if_free(a, helper, i);
    }
    for (i = a->image_count; i > 0 && !is_over(a); --i) {
        find_if_free(a, helper, i - 1);
    }
}

/* Half found when its turn comes: most often it is sooner ready than found again. */
static uint32_t look(const umb_ahead_image *image)
{
    uint32_t state = atomic_load_explicit(&image->state, memory_order_acquire);
    for (uint32_t i = 0; i < MOST_LOOKS && state == UMB_AHEAD_TAKEN; ++i) {
        for (uint32_t k = 0; k < 32; ++k) {
            atomic_signal_fence(memory_order_seq_cst);
        }
        state = atomic_load_explicit(&image->state, memory_order_acquire);
    }
    return state;
}

const umb_ahead_image *umb_ahead_take(umb_ahead *a, uint32_t occluder)
{
    umb_ahead_image *image = a->helper_count > 0 ? find(a, occluder) : NULL;
    if (image == NULL) {
        return NULL;
    }
    atomic_fetch_add_explicit(&a->walk, 1, memory_order_relaxed);
    return !claim(image, UMB_AHEAD_LEFT) && look(image) == UMB_AHEAD_READY ? image : NULL;
}

void umb_ahead_note(umb_ahead *a, uint32_t occluder, uint32_t edge_count)
{
    if (!a->on || a->scene->occluders[occluder].moves) {
        return;
    }
    uint32_t work = a->scene->occluders[occluder].mesh->block_position_count + EDGE_WORK * edge_count;
    if (work >= LEAST_IMAGE && a->noted_count < MOST_IMAGES) {
        a->noted[a->noted_count++] = occluder;
        a->noted_work += work;
    }
}

void umb_ahead_end(umb_ahead *a)
{
    atomic_store_explicit(&a->done, true, memory_order_relaxed);
}
