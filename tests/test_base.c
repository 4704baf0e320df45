/* Memory, sorting, exact collinearity, tasks, instruction sets, transforms. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/isa.h"
#include "base/memory.h"
#include "base/scratch.h"
#include "base/sort.h"
#include "geometry/collinear.h"
#include "geometry/transform.h"
#include "umbrage/umbrage.h"

static uint64_t random_state = 1;

static uint32_t random_bits(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 33);
}

static void test_memory(void **state)
{
    (void)state;
    umb_allocator a = umb_memory_allocator(NULL);
    uint32_t *array = NULL;
    size_t capacity = 0;
    for (uint32_t i = 0; i < 10000; ++i) {
        assert_true(umb_memory_reserve(&a, (void **)&array, &capacity, i + 1, sizeof *array));
        assert_int_equal((uintptr_t)array % 64, 0);
        array[i] = i;
    }
    for (uint32_t i = 0; i < 10000; ++i) {
        assert_int_equal(array[i], i);
    }
    size_t before = capacity;
    assert_false(umb_memory_reserve(&a, (void **)&array, &capacity, SIZE_MAX / 2, sizeof *array));
    assert_int_equal(capacity, before);
    umb_memory_free(&a, array, capacity * sizeof *array);
    assert_null(umb_memory_allocate_zero(&a, SIZE_MAX / 2, 4));
    assert_null(umb_memory_allocate(&a, SIZE_MAX));
    umb_scratch s = {.allocator = &a};
    assert_non_null(umb_scratch_get_zero(&s, 0, 8));
    void *p = umb_scratch_get(&s, 100, 8);
    assert_non_null(p);
    umb_scratch_drop(&s, p);
    umb_scratch_drop(&s, NULL);
    assert_null(umb_scratch_get(&s, SIZE_MAX, 8));
    assert_true(s.failed);
    umb_scratch_free(&s);
}

static void test_error_text(void **state)
{
    (void)state;
    umb_error e = {0};
    char longer[600];
    memset(longer, 'x', sizeof longer);
    longer[sizeof longer - 1] = '\0';
    assert_int_equal(umb_error_set(&e, UMB_ERROR_LIMIT, "%s", longer), UMB_ERROR_LIMIT);
    assert_int_equal(e.code, UMB_ERROR_LIMIT);
    assert_int_equal(strlen(e.text), sizeof e.text - 1);
    assert_int_equal(umb_error_set(NULL, UMB_ERROR_STATE, "no one listens"), UMB_ERROR_STATE);
    for (int r = UMB_OK; r <= UMB_ERROR_STATE; ++r) {
        assert_true(strlen(umb_result_name((umb_result)r)) > 0);
    }
    assert_string_equal(umb_version(), "0.1.0");
}

static void test_sort(void **state)
{
    (void)state;
    enum { MOST = 5000 };
    static uint64_t keys[MOST], scratch[MOST], original[MOST];
    static uint32_t values[MOST], value_scratch[MOST];
    for (int round = 0; round < 60; ++round) {
        size_t n = round < 20 ? (size_t)round * 5 : random_bits() % MOST;
        uint64_t mask = round % 3 == 0 ? 7 : round % 3 == 1 ? 0xFF00FF : UINT64_MAX;
        for (size_t i = 0; i < n; ++i) {
            keys[i] = original[i] = ((uint64_t)random_bits() << 33 ^ random_bits()) & mask;
            values[i] = (uint32_t)i;
        }
        umb_sort_keys(keys, values, scratch, value_scratch, n);
        for (size_t i = 0; i < n; ++i) {
            assert_true(keys[i] == original[values[i]]);
            if (i > 0) {
                assert_true(keys[i - 1] < keys[i] ||
                            (keys[i - 1] == keys[i] && values[i - 1] < values[i]));
            }
        }
    }
    static const float ordered[] = {-HUGE_VALF, -3e38f, -1.0f, -1e-45f,
                                    0.0f,       1e-45f, 1.0f,  HUGE_VALF};
    for (int i = 0; i + 1 < 8; ++i) {
        assert_true(umb_sort_float(ordered[i]) < umb_sort_float(ordered[i + 1]));
    }
    assert_int_equal(umb_sort_float(0.0f), umb_sort_float(-0.0f));
}

static int by_word(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Few and many, upper halves that differ, that agree in runs, and all alike. */
static void test_sort_words(void **state)
{
    (void)state;
    enum { MOST = 30000 };
    static const uint64_t masks[] = {UINT64_MAX, 0x700000FFFFFFFFu, 0xFFFFFFFFu, 0xFF00FF00000000u, 7, 0};
    static uint64_t words[MOST], scratch[MOST], expected[MOST];
    for (int round = 0; round < 120; ++round) {
        size_t n = round < 40 ? (size_t)round * 4 : random_bits() % (round % 2 ? MOST : 9000);
        for (size_t i = 0; i < n; ++i) {
            uint64_t high = random_bits();
            words[i] = expected[i] = (high << 33 ^ random_bits()) & masks[round % 6];
        }
        qsort(expected, n, sizeof(expected[0]), by_word);
        uint64_t *sorted = umb_sort_words(words, scratch, n);
        assert_true(sorted == words || sorted == scratch);
        assert_memory_equal(sorted, expected, n * sizeof(expected[0]));
        assert_ptr_equal(umb_sort_words(sorted, sorted == words ? scratch : words, n), sorted);
    }
}

/* The same by integers: coordinates below 2^20 leave every product far inside 64 bits. */
static int turn_by_integers(const int64_t a[3], const int64_t b[3], const int64_t c[3], int i, int j)
{
    int64_t d = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
    return (d > 0) - (d < 0);
}

static void test_collinear(void **state)
{
    (void)state;
    for (int round = 0; round < 200000; ++round) {
        int64_t p[3][3];
        float f[3][3];
        int64_t range = round % 2 == 0 ? 1 << 20 : 5;
        for (int k = 0; k < 9; ++k) {
            p[k / 3][k % 3] = (int64_t)(random_bits() % (uint64_t)range) - range / 2;
        }
        if (round % 3 == 0) { /* nearly or exactly on a line */
            int64_t m = random_bits() % 7, wobble = random_bits() % 4 == 0 ? 1 : 0;
            for (int k = 0; k < 3; ++k) {
                p[1][k] /= 16;
                p[2][k] = p[0][k] + (p[1][k] - p[0][k]) * m / 3 + (k == 1 ? wobble : 0);
            }
        }
        for (int k = 0; k < 9; ++k) { /* scaling by a power of two changes no sign */
            f[k / 3][k % 3] = ldexpf((float)p[k / 3][k % 3], round % 5 == 0   ? -140
                                                             : round % 7 == 0 ? 100
                                                                              : -9);
        }
        bool line = true;
        for (int k = 0; k < 3; ++k) {
            int wanted = turn_by_integers(p[0], p[1], p[2], k, (k + 1) % 3);
            line = line && wanted == 0;
            assert_int_equal(umb_collinear_turn(f[0], f[1], f[2], k, (k + 1) % 3), wanted);
        }
        assert_int_equal(umb_collinear(f[0], f[1], f[2]), line);
        int64_t along = 0, length = 0;
        for (int k = 0; k < 3; ++k) {
            along += (p[2][k] - p[0][k]) * (p[1][k] - p[0][k]);
            length += (p[1][k] - p[0][k]) * (p[1][k] - p[0][k]);
        }
        assert_int_equal(umb_collinear_inside(f[0], f[1], f[2]),
                         line && along > 0 && along < length);
    }
    static const float huge[3][3] = {{3e38f, -3e38f, 1e-45f}, {-3e38f, 3e38f, -1e-45f}, {0, 0, 0}};
    assert_true(umb_collinear_inside(huge[0], huge[1], huge[2]));
    static const float near[3][3] = {
        {3e38f, -3e38f, 1e-45f}, {-3e38f, 3e38f, -1e-45f}, {0, 1e-45f, 0}};
    assert_false(umb_collinear_inside(near[0], near[1], near[2]));
}

static void test_transform(void **state)
{
    (void)state;
    umb_transform t = {{{0}}};
    assert_true(umb_transform_is_identity(&t));
    t.m[0][0] = t.m[1][1] = t.m[2][2] = 1.0f;
    assert_true(umb_transform_is_identity(&t));
    assert_false(umb_transform_mirrors(&t));
    t.m[1][1] = -2.0f;
    t.m[2][3] = 0.5f;
    assert_false(umb_transform_is_identity(&t));
    assert_true(umb_transform_mirrors(&t));
    float p[3] = {1, 2, 3}, q[3];
    umb_transform_point(&t, p, q);
    assert_true(q[0] == 1.0f && q[1] == -4.0f && q[2] == 3.5f);
}

typedef struct counted_run {
    umb_pool *pool;
    atomic_uint counts[1000];
    uint32_t nested;
} counted_run;

static void count_one(void *data, uint32_t i)
{
    counted_run *run = data;
    atomic_fetch_add(&run->counts[i], 1);
    if (run->nested > 0 && i % 100 == 0) {
        static counted_run inner; /* every nested run counts into the same: only its total is looked at */
        umb_tasks tasks = umb_pool_tasks(run->pool);
        tasks.run(tasks.user, count_one, &inner, run->nested);
    }
}

static void run_and_check(umb_pool *pool, uint32_t count, uint32_t nested)
{
    counted_run run = {.pool = pool, .nested = nested};
    umb_tasks tasks = umb_pool_tasks(pool);
    umb_tasks_run(&tasks, count_one, &run, count);
    for (uint32_t i = 0; i < 1000; ++i) {
        assert_int_equal(atomic_load(&run.counts[i]), i < count ? 1 : 0);
    }
}

static void *other_caller(void *argument)
{
    for (int i = 0; i < 50; ++i) {
        run_and_check(argument, 200, 0);
    }
    return NULL;
}

static void test_pool(void **state)
{
    (void)state;
    umb_pool *pool = NULL;
    assert_int_equal(umb_pool_create(0, &pool), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_pool_create(257, &pool), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_pool_create(4, NULL), UMB_ERROR_ARGUMENT);
    umb_pool_destroy(NULL);
    static const uint32_t workers[] = {1, 2, 8};
    for (int k = 0; k < 3; ++k) {
        assert_int_equal(umb_pool_create(workers[k], &pool), UMB_OK);
        assert_int_equal(umb_pool_tasks(pool).workers, workers[k]);
        for (uint32_t count = 0; count < 200; ++count) {
            run_and_check(pool, count * 5, 0);
        }
        run_and_check(pool, 1000, 37);
        pthread_t other;
        assert_int_equal(pthread_create(&other, NULL, other_caller, pool), 0);
        (void)other_caller(pool);
        pthread_join(other, NULL);
        umb_pool_destroy(pool);
    }
    run_and_check(NULL, 1000, 0); /* no pool: a plain loop */
}

static void test_isa(void **state)
{
    (void)state;
    assert_true(umb_isa_available(UMB_ISA_AUTO));
    assert_true(umb_isa_available(UMB_ISA_SCALAR));
    assert_false(umb_isa_available((umb_isa)99));
    for (int i = UMB_ISA_SCALAR; i <= UMB_ISA_NEON; ++i) {
        umb_isa resolved = UMB_ISA_AUTO;
        umb_result result = umb_isa_resolve((umb_isa)i, &resolved);
        assert_int_equal(result == UMB_OK, umb_isa_available((umb_isa)i));
        assert_int_equal(resolved, result == UMB_OK ? i : UMB_ISA_SCALAR);
    }
    umb_isa best = UMB_ISA_AUTO;
    assert_int_equal(umb_isa_resolve(UMB_ISA_AUTO, &best), UMB_OK);
    assert_true(best != UMB_ISA_AUTO && umb_isa_available(best));
    assert_string_equal(umb_isa_name(UMB_ISA_AUTO), umb_isa_name(best));
    assert_string_equal(umb_isa_name(UMB_ISA_SCALAR), "scalar");
    assert_string_equal(umb_isa_name(UMB_ISA_NEON), "neon");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_memory),    cmocka_unit_test(test_error_text),
        cmocka_unit_test(test_sort), cmocka_unit_test(test_sort_words),      cmocka_unit_test(test_collinear),
        cmocka_unit_test(test_transform), cmocka_unit_test(test_pool),
        cmocka_unit_test(test_isa),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
