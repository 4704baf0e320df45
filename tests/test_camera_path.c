/* Camera paths: what is a row, what is a header, and where errors are. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/model.h"
#include "io/readers.h"
#include "support/random_boxes.h"

static bool read_text(const char *text, camera_path *out, umb_error *error)
{
    /* A block of exactly its size plus the zero that inputs have behind them. */
    size_t size = strlen(text);
    char *copy = malloc(size + 1);
    assert_non_null(copy);
    memcpy(copy, text, size + 1);
    bool read = read_camera_path(copy, size, "it.csv", out, error);
    free(copy);
    return read;
}

static void rows(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        uint32_t count;
    } good[] = {
        {"1,2,3,4,5,6\n", 1},
        {"1,2,3,4,5,6", 1},
        {"1,2,3,4,5,6\r\n-1.5,2e3,+3,4,5,6\r\n", 2},
        {"ex,ey,ez,tx,ty,tz\n1,2,3,4,5,6\n", 1},
        {"\xEF\xBB\xBF"
         "ex,ey,ez,tx,ty,tz\n1,2,3,4,5,6\n",
         1},
        {"# a path\n\n  \n 1 , 2 ,\t3, 4, 5, 6 \n\n", 1},
        {"x\ny\n1,2,3,4,5,6\n\n2,3,4,5,6,7\n", 2},
    };
    for (size_t i = 0; i < sizeof good / sizeof good[0]; ++i) {
        camera_path path;
        umb_error error;
        assert_true(read_text(good[i].text, &path, &error));
        assert_int_equal(path.count, good[i].count);
        assert_true(path.rows[0][1] == 2.0 && path.rows[0][5] == 6.0);
        camera_path_free(&path);
    }
}

static void errors_say_where(void **state)
{
    (void)state;
    static const struct {
        const char *text, *where;
    } bad[] = {
        {"", "it.csv:"},
        {"\n\n", "it.csv:"},
        {"ex,ey\n", "it.csv:"},
        {"1,2,3,4,5\n", "it.csv:1:"},
        {"1,2,3,4,5,6,7\n", "it.csv:1:"},
        {"1,2,3,4,5,6\n\n1,2,3,4,5\n", "it.csv:3:"},
        {"1,2,3,4,5,6\nex,ey,ez,tx,ty,tz\n", "it.csv:2:"},
        {"1,2,3,4,5,nan\n", "it.csv:1:"},
        {"1,2,3,4,5,inf\n", "it.csv:1:"},
        {"1,2,3,4,5,1e999\n", "it.csv:1:"},
        {"1,2,3,,5,6\n", "it.csv:1:"},
        {"1,2,3,4x,5,6\n", "it.csv:1:"},
        {"1 2 3 4 5 6\n2,x\n", "it.csv:1:"},
        {"view 1,2,3,4,5,6\n", "it.csv:1:"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        camera_path path;
        umb_error error = {0};
        assert_false(read_text(bad[i].text, &path, &error));
        assert_ptr_equal(strstr(error.text, bad[i].where), error.text);
        assert_null(path.rows);
        assert_int_equal(path.count, 0);
    }
}

/* What is written with 17 digits is read to the bit. */
static void digits_survive(void **state)
{
    (void)state;
    uint64_t random = 4;
    double written[600][6];
    char *text = calloc(600, 200);
    assert_non_null(text);
    size_t used = 0;
    for (int row = 0; row < 600; ++row) {
        for (int k = 0; k < 6; ++k) {
            written[row][k] = random_power(&random, -8.0, 8.0);
            used += (size_t)sprintf(text + used, "%.17g%c", written[row][k], k < 5 ? ',' : '\n');
        }
    }
    camera_path path;
    umb_error error;
    assert_true(read_text(text, &path, &error));
    assert_int_equal(path.count, 600);
    assert_memory_equal(path.rows, written, sizeof written);
    camera_path_free(&path);
    free(text);
}

static void files(void **state)
{
    (void)state;
    char name[] = "/tmp/umbrage-path-XXXXXX";
    int file = mkstemp(name);
    assert_true(file >= 0);
    camera_path path;
    umb_error error;
    assert_false(camera_path_load(name, &path, &error));
    assert_int_equal(write(file, "1,2,3,4,5,6\n", 12), 12);
    assert_true(camera_path_load(name, &path, &error));
    assert_int_equal(path.count, 1);
    camera_path_free(&path);
    assert_int_equal(close(file), 0);
    assert_int_equal(unlink(name), 0);
    assert_false(camera_path_load(name, &path, &error));
    assert_non_null(strstr(error.text, name));
    assert_false(camera_path_load("/tmp", &path, NULL));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows),
        cmocka_unit_test(errors_say_where),
        cmocka_unit_test(digits_survive),
        cmocka_unit_test(files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
