/* A pool of threads that serves one run at a time.
 *
 * A run opens a job; the caller and every thread that wakes in time draw task numbers from one
 * counter until none is left; the caller closes the job and waits for the threads still inside. A
 * thread that wakes late finds the job closed, or the counter used up, and does nothing: so no run
 * waits for a thread that has no work. */
#include <pthread.h>
#include <stdatomic.h>

#include "memory.h"

#define MAX_WORKERS 256u

struct umb_pool {
    pthread_mutex_t serve; /* held by the caller of a run, so that runs follow one another */
    pthread_mutex_t mutex; /* guards all below but next */
    pthread_cond_t wake, idle;
    void (*task)(void *data, uint32_t i);
    void *data;
    uint64_t count;
    uint64_t generation; /* of the job: a thread enters each job at most once */
    uint32_t inside;     /* threads that have entered the job and not left it */
    bool open, stop;
    pthread_t caller; /* of the job that is open or closing; valid while running */
    bool running;
    _Atomic uint64_t next; /* 64 bits: drawing past the end must never wrap */
    uint32_t thread_count;
    pthread_t threads[MAX_WORKERS];
};

void umb_tasks_run(const umb_tasks *tasks, void (*task)(void *data, uint32_t i), void *data,
                   uint32_t count)
{
    if (tasks != NULL && tasks->run != NULL && count > 1) {
        tasks->run(tasks->user, task, data, count);
        return;
    }
    for (uint32_t i = 0; i < count; ++i) {
        task(data, i);
    }
}

static void draw_tasks(umb_pool *pool, void (*task)(void *data, uint32_t i), void *data,
                       uint64_t count)
{
    for (;;) {
        uint64_t i = atomic_fetch_add_explicit(&pool->next, 1, memory_order_relaxed);
        if (i >= count) {
            return;
        }
        task(data, (uint32_t)i);
    }
}

static void *thread_main(void *argument)
{
    umb_pool *pool = argument;
    uint64_t seen = 0;
    pthread_mutex_lock(&pool->mutex);
    for (;;) {
        while (!pool->stop && (!pool->open || pool->generation == seen)) {
            pthread_cond_wait(&pool->wake, &pool->mutex);
        }
        if (pool->stop) {
            break;
        }
        seen = pool->generation;
        void (*task)(void *data, uint32_t i) = pool->task;
        void *data = pool->data;
        uint64_t count = pool->count;
        pool->inside += 1;
        pthread_mutex_unlock(&pool->mutex);
        draw_tasks(pool, task, data, count);
        pthread_mutex_lock(&pool->mutex);
        pool->inside -= 1;
        if (pool->inside == 0) {
            pthread_cond_signal(&pool->idle);
        }
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}

/* True on a thread that is executing a task of this pool. */
static bool is_nested(umb_pool *pool)
{
    pthread_t self = pthread_self();
    for (uint32_t i = 0; i < pool->thread_count; ++i) {
        if (pthread_equal(self, pool->threads[i])) {
            return true;
        }
    }
    pthread_mutex_lock(&pool->mutex);
    bool nested = pool->running && pthread_equal(self, pool->caller);
    pthread_mutex_unlock(&pool->mutex);
    return nested;
}

static void pool_run(void *user, void (*task)(void *data, uint32_t i), void *data, uint32_t count)
{
    umb_pool *pool = user;
    if (count < 2 || pool->thread_count == 0 || is_nested(pool)) {
        for (uint32_t i = 0; i < count; ++i) {
            task(data, i);
        }
        return;
    }
    pthread_mutex_lock(&pool->serve);
    pthread_mutex_lock(&pool->mutex);
    pool->task = task;
    pool->data = data;
    pool->count = count;
    pool->generation += 1;
    pool->caller = pthread_self();
    pool->running = true;
    pool->open = true;
    atomic_store_explicit(&pool->next, 0, memory_order_relaxed);
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->mutex);

    draw_tasks(pool, task, data, count);

    pthread_mutex_lock(&pool->mutex);
    pool->open = false;
    while (pool->inside > 0) {
        pthread_cond_wait(&pool->idle, &pool->mutex);
    }
    pool->running = false;
    pthread_mutex_unlock(&pool->mutex);
    pthread_mutex_unlock(&pool->serve);
}

static void stop_threads(umb_pool *pool)
{
    pthread_mutex_lock(&pool->mutex);
    pool->stop = true;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->mutex);
    for (uint32_t i = 0; i < pool->thread_count; ++i) {
        pthread_join(pool->threads[i], NULL);
    }
}

umb_result umb_pool_create(uint32_t workers, umb_pool **out)
{
    if (out == NULL) {
        return UMB_ERROR_ARGUMENT;
    }
    *out = NULL;
    if (workers < 1 || workers > MAX_WORKERS) {
        return UMB_ERROR_ARGUMENT;
    }
    umb_allocator allocator = umb_memory_allocator(NULL);
    umb_pool *pool = umb_memory_allocate_zero(&allocator, 1, sizeof *pool);
    if (pool == NULL) {
        return UMB_ERROR_MEMORY;
    }
    pthread_mutex_init(&pool->serve, NULL);
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->wake, NULL);
    pthread_cond_init(&pool->idle, NULL);
    for (uint32_t i = 0; i + 1 < workers; ++i) {
        if (pthread_create(&pool->threads[i], NULL, thread_main, pool) != 0) {
            umb_pool_destroy(pool);
            return UMB_ERROR_MEMORY;
        }
        pool->thread_count = i + 1;
    }
    *out = pool;
    return UMB_OK;
}

void umb_pool_destroy(umb_pool *pool)
{
    if (pool == NULL) {
        return;
    }
    stop_threads(pool);
    pthread_cond_destroy(&pool->idle);
    pthread_cond_destroy(&pool->wake);
    pthread_mutex_destroy(&pool->mutex);
    pthread_mutex_destroy(&pool->serve);
    umb_allocator allocator = umb_memory_allocator(NULL);
    umb_memory_free(&allocator, pool, sizeof *pool);
}

umb_tasks umb_pool_tasks(umb_pool *pool)
{
    umb_tasks tasks = {pool_run, pool, pool != NULL ? pool->thread_count + 1 : 1};
    if (pool == NULL) {
        tasks.run = NULL;
    }
    return tasks;
}
