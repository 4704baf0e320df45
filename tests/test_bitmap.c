/* Pictures: blending, clipping, drawing against area, PNG round trip. */
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "io/bitmap.h"

/* How much of the picture is white, in pixels; the ground is black. */
static double white_area(const bitmap *im)
{
    double sum = 0;
    for (size_t k = 0; k < 3 * (size_t)im->width * im->height; ++k) {
        sum += im->pixels[k] / 255.0 / 3.0;
    }
    return sum;
}

static void test_colors(void **state)
{
    (void)state;
    assert_int_equal(bitmap_mix(0x000000, 0xFFFFFF, 0.5), 0x808080);
    assert_int_equal(bitmap_mix(0x123456, 0xABCDEF, 0), 0x123456);
    assert_int_equal(bitmap_mix(0x123456, 0xABCDEF, 2), 0xABCDEF);
    bitmap im;
    assert_false(bitmap_create(&im, 0, 5));
    assert_false(bitmap_create(&im, 40000, 5));
    assert_true(bitmap_create(&im, 3, 2));
    bitmap_fill(&im, 0x102030);
    bitmap_set(&im, 2, 1, 0x405060);
    bitmap_set(&im, 3, 1, 0xFFFFFF);
    bitmap_set(&im, -1, 0, 0xFFFFFF);
    bitmap_set(&im, 0, 2, 0xFFFFFF);
    assert_int_equal(bitmap_get(&im, 2, 1), 0x405060);
    assert_int_equal(bitmap_get(&im, 0, 1), 0x102030);
    assert_int_equal(bitmap_get(&im, 7, 7), 0);
    bitmap_free(&im);
}

static void test_areas(void **state)
{
    (void)state;
    bitmap im;
    static const double square[4][2] = {{10.25, 10.5}, {30.75, 10.5}, {30.75, 20.25}, {10.25, 20.25}};
    static const double back[3][2] = {{-50, 32}, {200, 70}, {-50, 70}};
    assert_true(bitmap_create(&im, 64, 64));
    bitmap_polygon(&im, square, 4, 0xFFFFFF, 1.0);
    assert_true(fabs(white_area(&im) - 20.5 * 9.75) < 1.0);
    bitmap_fill(&im, 0);
    bitmap_polygon(&im, back, 3, 0xFFFFFF, 1.0); /* reaches far out of the picture on three sides */
    double low = 32 + 38 * 50 / 250.0, high = 32 + 38 * 114 / 250.0;
    assert_true(fabs(white_area(&im) - 64 * (64 - (low + high) / 2)) < 64);
    bitmap_fill(&im, 0);
    bitmap_disc(&im, 32, 32, 10, 0xFFFFFF, 1.0);
    assert_true(fabs(white_area(&im) - 314.16) < 4.0);
    bitmap_fill(&im, 0);
    bitmap_line(&im, 10, 10, 40, 50, 3, 0xFFFFFF, 1.0);
    assert_true(fabs(white_area(&im) - (50 * 3 + 7.07)) < 4.0);
    bitmap_fill(&im, 0);
    bitmap_line(&im, -1e7, 20, 1e7, 20, 2, 0xFFFFFF, 1.0);
    assert_true(fabs(white_area(&im) - 128) < 1.0);
    bitmap_fill(&im, 0);
    bitmap_line(&im, -30, -30, -3, 90, 2, 0xFFFFFF, 1.0);
    assert_true(white_area(&im) == 0);
    bitmap_rectangle(&im, -5, 60, 10, 10, 0xFFFFFF, 0.5);
    assert_true(fabs(white_area(&im) - 10) < 0.2);
    bitmap_fill(&im, 0);
    bitmap_frame(&im, 8, 8, 10, 6, 2, 0xFFFFFF);
    assert_true(fabs(white_area(&im) - (60 - 12)) < 0.01);
    bitmap_free(&im);
}

static void test_text(void **state)
{
    (void)state;
    bitmap im;
    assert_true(bitmap_create(&im, 100, 40));
    bitmap_text(&im, 4, 4, 2, "visible\xFF", 0xFFFFFF);
    double area = white_area(&im);
    assert_true(area > 200 && area < 1200);
    assert_true(bitmap_text_width("visible", 2) == 2 * bitmap_text_width("visible", 1));
    for (int y = 0; y < 40; ++y) {
        for (int x = 4 + bitmap_text_width("visible?", 2); x < 100; ++x) {
            assert_int_equal(bitmap_get(&im, x, y), 0);
        }
    }
    bitmap_free(&im);
}

static void test_sizes(void **state)
{
    (void)state;
    bitmap small, large;
    assert_true(bitmap_create(&small, 4, 3) && bitmap_create(&large, 8, 6));
    for (int k = 0; k < 48; ++k) {
        bitmap_set(&large, k % 8, k / 8, (k % 8 + k / 8) & 1 ? 0xFFFFFF : 0);
    }
    bitmap_shrink(&small, &large, 2);
    assert_int_equal(bitmap_get(&small, 3, 2), 0x808080);
    bitmap_set(&small, 1, 2, 0xFF0000);
    bitmap_stretch(&large, &small);
    assert_int_equal(bitmap_get(&large, 2, 4), 0xFF0000);
    assert_int_equal(bitmap_get(&large, 3, 5), 0xFF0000);
    assert_int_equal(bitmap_get(&large, 4, 5), 0x808080);
    bitmap_free(&small);
    bitmap_free(&large);
}

static void test_png(void **state)
{
    (void)state;
    char path[64];
    bitmap im;
    umb_error error = {0};
    png_image back = {.version = PNG_IMAGE_VERSION};
    uint8_t pixels[7 * 5 * 3];
    snprintf(path, sizeof path, "test_bitmap_%ld.png", (long)getpid());
    assert_true(bitmap_create(&im, 7, 5));
    for (int k = 0; k < 35; ++k) {
        bitmap_set(&im, k % 7, k / 7, (bitmap_color)(k * 7919 * 211) & 0xFFFFFF);
    }
    assert_true(bitmap_write_png(&im, path, &error));
    assert_true(png_image_begin_read_from_file(&back, path));
    assert_int_equal(back.width, 7);
    assert_int_equal(back.height, 5);
    back.format = PNG_FORMAT_RGB;
    assert_true(png_image_finish_read(&back, NULL, pixels, 0, NULL));
    assert_memory_equal(pixels, im.pixels, sizeof pixels);
    remove(path);
    assert_false(bitmap_write_png(&im, "no/such/folder/a.png", &error));
    assert_non_null(strstr(error.text, "no/such/folder"));
    if (access("/dev/full", W_OK) == 0) {
        assert_false(bitmap_write_png(&im, "/dev/full", &error));
        assert_int_equal(access("/dev/full", F_OK), 0);
    }
    bitmap_free(&im);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_colors), cmocka_unit_test(test_areas),
                                       cmocka_unit_test(test_text), cmocka_unit_test(test_sizes),
                                       cmocka_unit_test(test_png)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
