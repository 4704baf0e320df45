#include "scene_tests.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static uint32_t part, parts = 1;
static const char *only = "";

void scene_tests_arguments(int argc, char **argv)
{
    if (argc > 2) {
        part = (uint32_t)atoi(argv[1]);
        parts = atoi(argv[2]) > 0 ? (uint32_t)atoi(argv[2]) : 1;
    }
    if (argc > 3) {
        only = argv[3];
    }
}

void scene_tests_run(uint64_t (*check)(const real_scene *scene))
{
    const char *folder = getenv("UMBRAGE_SCENES");
    real_scenes all;
    umb_error error = {0};
    uint64_t bad = 0;
    if (folder == NULL || folder[0] == '\0') {
        print_message("skipped: UMBRAGE_SCENES names no folder of real scenes\n");
        skip();
    }
    if (!real_scenes_find(folder, &all, &error)) {
        fail_msg("%s", error.text);
    }
    assert_true(all.count > 0);
    for (uint32_t i = 0; i < all.count; ++i) {
        if (i % parts == part && strstr(all.scenes[i].name, only) != NULL) {
            bad += check(&all.scenes[i]);
        }
    }
    real_scenes_free(&all);
    assert_int_equal(bad, 0);
}

double scene_tests_mean(uint64_t sum, uint64_t count)
{
    return count != 0 ? (double)sum / (double)count : 0.0;
}
