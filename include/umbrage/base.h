/* Results, errors, memory and tasks: what every other header stands on.
 *
 * Umbrage has no globals, starts no thread unless asked and never prints or aborts. Every call that
 * can fail returns an umb_result; a zeroed descriptor struct is always valid and means the default.
 */
#ifndef UMBRAGE_BASE_H
#define UMBRAGE_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define UMB_API
#elif defined(__GNUC__)
#define UMB_API __attribute__((visibility("default")))
#else
#define UMB_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define UMB_VERSION_MAJOR 0
#define UMB_VERSION_MINOR 1
#define UMB_VERSION_PATCH 0

/* No object, no index, no node. Ids are dense from 0; this is the one value that is never an id. */
#define UMB_NONE UINT32_MAX

/* What a call says of itself. The numbers are pinned: they may be stored and compared over
 * versions. */
typedef enum umb_result {
    UMB_OK = 0,
    UMB_ERROR_MEMORY = 1,   /* the allocator returned NULL; nothing changed */
    UMB_ERROR_ARGUMENT = 2, /* a rule of the call was broken: NaN, inverted bounds, unknown id, ... */
    UMB_ERROR_FORMAT = 3,   /* bytes that are not what they claim to be: magic, size, checksum, range */
    UMB_ERROR_VERSION = 4,  /* bytes of a version that this library does not read */
    UMB_ERROR_LIMIT = 5,    /* more than the library can number (2^30 objects, 2^32 bytes of a block) */
    UMB_ERROR_STATE = 6     /* a call at the wrong time: a scene changed but not committed, ... */
} umb_result;

/* Text for people beside the code. The caller owns it; descriptors take a pointer to one. A failing
 * call on an object made with that descriptor fills it in; a succeeding call leaves it alone. */
typedef struct umb_error {
    umb_result code;
    char text[252]; /* one line, no newline at its end, always terminated */
} umb_error;

/* One function for all memory, with the caller's context.
 *   old == NULL: allocate new_size bytes, aligned to 64.
 *   new_size == 0: free old (old_size bytes), return NULL.
 *   otherwise: resize, keeping the first min(old_size, new_size) bytes, aligned to 64.
 * Returns NULL when there is no memory; old is then still valid. Must be callable from the threads
 * that call into objects made with it. */
typedef struct umb_allocator {
    void *(*reallocate)(void *user, void *old, size_t old_size, size_t new_size);
    void *user;
} umb_allocator;

/* Parallel work through the caller's own job system.
 *   run: call task(data, i) once for each i in [0, count), in any order, on any threads, and return
 *   when all have returned. Tasks never wait for one another. workers is a hint of how many run at
 *   once; results of every call of this library are the same for every value of it.
 * A zeroed struct means: on the calling thread. */
typedef struct umb_tasks {
    void (*run)(void *user, void (*task)(void *data, uint32_t i), void *data, uint32_t count);
    void *user;
    uint32_t workers;
} umb_tasks;

/* A small thread pool for programs without a job system of their own. */
typedef struct umb_pool umb_pool;

/* Start workers - 1 threads (the caller of run is the other one). workers: 1 to 256.
 * The pool may serve several callers, one run at a time; a nested run is executed on its caller. */
UMB_API umb_result umb_pool_create(uint32_t workers, umb_pool **out);
/* Join the threads and free the pool. NULL is allowed. No run may be in progress. */
UMB_API void umb_pool_destroy(umb_pool *pool);
/* The task callback that runs on this pool; valid until the pool is destroyed. */
UMB_API umb_tasks umb_pool_tasks(umb_pool *pool);

/* Which instruction set the kernels use. Answers never depend on it. AUTO takes the best that both
 * the library was built with and the processor has; naming one that is missing is an error. */
typedef enum umb_isa {
    UMB_ISA_AUTO = 0,
    UMB_ISA_SCALAR = 1,
    UMB_ISA_SSE4 = 2,
    UMB_ISA_AVX2 = 3,
    UMB_ISA_NEON = 4
} umb_isa;

/* True if kernels for isa are built in and this processor runs them. */
UMB_API bool umb_isa_available(umb_isa isa);
/* "scalar", "sse4", ...; for AUTO the name of what AUTO stands for on this machine. */
UMB_API const char *umb_isa_name(umb_isa isa);

/* "0.1.0", from the macros above. */
UMB_API const char *umb_version(void);
/* A short fixed name of a result, e.g. "out of memory". */
UMB_API const char *umb_result_name(umb_result result);

#ifdef __cplusplus
}
#endif
#endif
