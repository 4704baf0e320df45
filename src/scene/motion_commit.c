/* Commits of objects that move by themselves: those that are due get their volumes first, what readers see follows last. */
#include <math.h>

#include "scene_state.h"

static void note_expired(void *user, uint32_t mover)
{
    umb_motion_make_due(user, mover, UMB_DUE_EXPIRED);
}

void umb_motion_commit(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    umb_motion *c = &scene->committed.motion;
    m->stats = (umb_motion_stats){0};
    m->commit += 1;
    umb_witnesses_listen(scene);
    bool back = m->time < m->made_at;
    m->made_at = m->time;
    if (back) {
        for (uint32_t i = 0; i < m->ids.used; ++i) {
            if (m->objects[i] != UMB_NONE) {
                umb_motion_make_due(m, i, UMB_DUE_FRESH);
            }
        }
    }
    umb_motion queue = {.expiries = m->expiries.heap, .expiry_count = m->expiries.count};
    umb_motion_expired(&queue, m->time, note_expired, m);
    c->time = m->due_count > 0 ? INFINITY : c->time;
    for (uint32_t i = 0; i < m->due_count; ++i) {
        if ((m->slots[m->due[i]].why & UMB_DUE_STOP) != 0) {
            umb_motion_stop(scene, m->due[i]);
        } else {
            umb_motion_make_volume(scene, m->due[i]);
        }
    }
}

static void sink(uint32_t *numbers, uint32_t at, uint32_t count)
{
    uint32_t number = numbers[at];
    for (uint32_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
        child += child + 1 < count && numbers[child + 1] > numbers[child];
        if (numbers[child] <= number) {
            break;
        }
        numbers[at] = numbers[child];
        at = child;
    }
    numbers[at] = number;
}

/* In place, without memory. */
static void sort_numbers(uint32_t *numbers, uint32_t count)
{
    for (uint32_t i = count / 2; i-- > 0;) {
        sink(numbers, i, count);
    }
    for (uint32_t i = count; i-- > 1;) {
        uint32_t last = numbers[i];
        numbers[i] = numbers[0];
        numbers[0] = last;
        sink(numbers, 0, i);
    }
}

/* Bring the exact ones in order, of which all but a few at the end are: commits then go through memory in order, which for
 * thousands is worth more than anything else. due is room to work in. */
static void order_exact(umb_movers_state *m)
{
    uint32_t *list = m->exact, count = m->exact_count, sorted = count > 0 ? 1 : 0, to = count;
    while (sorted < count && list[sorted] > list[sorted - 1]) {
        ++sorted;
    }
    uint32_t rest = count - sorted;
    sort_numbers(list + sorted, rest);
    for (uint32_t i = 0; i < rest; ++i) {
        m->due[i] = list[sorted + i];
    }
    while (rest > 0) {
        list[--to] = sorted > 0 && list[sorted - 1] > m->due[rest - 1] ? list[--sorted] : m->due[--rest];
    }
}

void umb_motion_committed(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    for (uint32_t i = 0; i < m->due_count; ++i) {
        uint32_t number = m->due[i];
        if ((m->slots[number].why & UMB_DUE_STOP) != 0) {
            umb_expiries_set(&m->expiries, number, INFINITY);
            m->objects[number] = UMB_NONE;
            m->count -= 1;
            m->fuzzy -= m->promises[number].def.fuzzy;
            m->slots[number].exact = false;
            umb_ids_release(&m->ids, number);
        }
        m->slots[number].why = 0;
    }
    m->due_count = 0;
    uint32_t *exact = m->exact;
    size_t exact_capacity = m->exact_capacity;
    m->exact = m->next_exact;
    m->exact_capacity = m->next_exact_capacity;
    m->exact_count = m->next_exact_count;
    m->next_exact = exact;
    m->next_exact_capacity = exact_capacity;
    order_exact(m);
    umb_ids_commit(&m->ids);
    umb_motion *c = &scene->committed.motion;
    umb_motion_publish_arrays(scene);
    c->number_count = m->ids.used;
    c->count = m->count;
    c->expiry_count = m->expiries.count;
    c->exact_count = m->exact_count;
    c->fuzzy = m->fuzzy;
    c->time = m->time;
}
