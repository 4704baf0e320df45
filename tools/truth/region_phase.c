/* Blocks of items, and how what their tasks find is joined, looked into and kept. */
#include <stdlib.h>
#include <string.h>

#include "region_hunt.h"

#define TASK_RAYS 1024u /* about as many rays a task of a block */
#define CONFIRMED_AT_ONCE 8u
#define PENDING 64u /* bit of a triangle's state: a find of this block waits */

static void run(const region_hunt *h, void (*task)(void *data, uint32_t i), void *data,
                uint32_t count)
{
    const umb_tasks *tasks = &h->options->tasks;
    if (tasks->run != NULL && count > 1) {
        tasks->run(tasks->user, task, data, count);
        return;
    }
    for (uint32_t i = 0; i < count; ++i) {
        task(data, i);
    }
}

static void cast_task(void *data, uint32_t i)
{
    region_hunt *h = data;
    region_hand *hand = &h->hands[i];
    uint64_t first = h->first_item + i * h->items_per_task;
    uint64_t end = h->first_item + h->item_count;
    for (uint64_t k = 0; k < h->items_per_task && first + k < end && !hand->failed; ++k) {
        h->item(hand, first + k);
    }
}

static void confirm_task(void *data, uint32_t i)
{
    region_hunt *h = data;
    for (uint32_t k = i * CONFIRMED_AT_ONCE; k < (i + 1) * CONFIRMED_AT_ONCE; ++k) {
        if (k < h->pending_count) {
            h->pending[k]->proven = region_confirm(h, h->pending[k]);
        }
    }
}

/* Room for one element more. */
static bool reserve(void **array, uint32_t *capacity, uint32_t count, size_t size)
{
    if (count < *capacity) {
        return true;
    }
    uint32_t more = 2 * *capacity + 256;
    void *p = realloc(*array, more * size);
    if (p == NULL) {
        return false;
    }
    *array = p;
    *capacity = more;
    return true;
}

static uint8_t *state_of(region_hunt *h, const region_find *f)
{
    return &h->states[h->t->first_triangle[f->object] + f->triangle];
}

/* Of the finds of a triangle the first one, by task. */
static void gather(region_hunt *h)
{
    h->pending_count = 0;
    for (uint32_t i = 0; i < REGION_HANDS; ++i) {
        region_hand *hand = &h->hands[i];
        for (uint32_t k = 0; k < hand->find_count; ++k) {
            region_find *f = &hand->finds[k];
            uint8_t *state = state_of(h, f);
            if (*state & (PENDING | REGION_SEEN)) {
                continue;
            }
            *state |= PENDING;
            if (!reserve((void **)&h->pending, &h->pending_capacity, h->pending_count,
                         sizeof(region_find *))) {
                h->failed = true;
                return;
            }
            h->pending[h->pending_count++] = f;
        }
    }
}

static void keep_leak(region_hunt *h, const region_find *f)
{
    const uint8_t *accused = h->options->accused;
    if (accused == NULL || accused[f->object] == 0 || h->leak_of[f->object] != MODEL_NONE) {
        return;
    }
    if (!reserve((void **)&h->leaks, &h->leak_capacity, h->leak_count, sizeof *h->leaks)) {
        h->failed = true;
        return;
    }
    h->leak_of[f->object] = h->leak_count;
    h->leaks[h->leak_count++] = *f;
}

static void settle(region_hunt *h, const region_find *f)
{
    uint8_t *state = state_of(h, f);
    *state &= (uint8_t)~PENDING;
    if (!f->proven) {
        *state = (uint8_t)(*state + REGION_LEAK);
        keep_leak(h, f);
        return;
    }
    *state |= REGION_SEEN;
    if (!reserve((void **)&h->witnesses, &h->witness_capacity, h->witness_count,
                 sizeof *h->witnesses)) {
        h->failed = true;
        return;
    }
    if (h->witness_of[f->object] == MODEL_NONE) {
        h->witness_of[f->object] = h->witness_count;
    }
    h->witnesses[h->witness_count++] = f->witness;
}

static void join_hands(region_hunt *h)
{
    for (uint32_t i = 0; i < REGION_HANDS; ++i) {
        region_hand *hand = &h->hands[i];
        for (uint32_t k = 0; k < hand->behind_count; ++k) {
            uint32_t object = hand->behind[k];
            h->candidate[object] |= REGION_LIKELY;
        }
        hand->behind_count = 0;
        hand->find_count = 0;
        h->cast += hand->rays;
        hand->rays = 0;
        h->failed |= hand->failed;
    }
}

static void run_block(region_hunt *h)
{
    uint32_t tasks = (uint32_t)((h->item_count + h->items_per_task - 1) / h->items_per_task);
    run(h, cast_task, h, tasks);
    gather(h);
    run(h, confirm_task, h, (h->pending_count + CONFIRMED_AT_ONCE - 1) / CONFIRMED_AT_ONCE);
    for (uint32_t k = 0; k < h->pending_count && !h->failed; ++k) {
        settle(h, h->pending[k]);
    }
    join_hands(h);
}

uint64_t region_phase(region_hunt *h, region_item item, uint64_t first, uint64_t count,
                      uint32_t rays_each, uint64_t most)
{
    uint64_t before = h->cast, done = 0;
    ++h->phase;
    h->item = item;
    h->items_per_task = 1 + TASK_RAYS / (rays_each + 1);
    while (done < count && h->cast - before < most && h->cast < h->budget && !h->failed) {
        uint64_t left = count - done, block = REGION_HANDS * h->items_per_task;
        h->first_item = first + done;
        h->item_count = left < block ? left : block;
        run_block(h);
        done += h->item_count;
    }
    return done;
}
