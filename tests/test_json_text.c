/* JSON text against an independent parser. The writer belongs to the program, not to a library. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>
#include <jansson.h>

#include "umbrage/json_text.c"

static uint64_t state = 20240607;

static uint64_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

static json_t *parse(json_text *j)
{
    json_error_t error;
    assert_false(j->failed);
    json_t *root = json_loadb(j->text, j->used, JSON_DECODE_ANY | JSON_REJECT_DUPLICATES, &error);
    if (!root) {
        print_error("%s\n%.*s\n", error.text, (int)j->used, j->text);
    }
    assert_non_null(root);
    assert_null(memchr(j->text, '\n', j->used));
    json_text_free(j);
    return root;
}

static void test_structure(void **unused)
{
    static const uint32_t ids[] = {3, 0, UINT32_MAX};
    static const double point[3] = {0.1, -2.0, 1e300};
    json_text j = {0};
    (void)unused;
    json_text_open(&j, NULL, '{');
    json_text_open(&j, "empty", '[');
    json_text_close(&j, ']');
    json_text_ids(&j, "ids", ids, 3);
    json_text_ids(&j, "none", ids, 0);
    json_text_point(&j, "point", point);
    json_text_bool(&j, "yes", true);
    json_text_string(&j, "nothing", NULL);
    json_text_number(&j, "nan", NAN);
    json_text_number(&j, "inf", -INFINITY);
    json_text_count(&j, "most", INT64_MAX);
    json_text_open(&j, "list", '[');
    for (int i = 0; i < 2; ++i) {
        json_text_open(&j, NULL, '{');
        json_text_count(&j, "i", (uint64_t)i);
        json_text_close(&j, '}');
    }
    json_text_close(&j, ']');
    json_text_close(&j, '}');
    json_t *root = parse(&j);
    assert_int_equal(json_object_size(root), 10);
    assert_int_equal(json_array_size(json_object_get(root, "empty")), 0);
    assert_int_equal(json_array_size(json_object_get(root, "none")), 0);
    assert_int_equal(json_integer_value(json_array_get(json_object_get(root, "ids"), 2)),
                     UINT32_MAX);
    assert_true(json_real_value(json_array_get(json_object_get(root, "point"), 0)) == 0.1);
    assert_true(json_is_true(json_object_get(root, "yes")));
    assert_true(json_is_null(json_object_get(root, "nothing")));
    assert_true(json_is_null(json_object_get(root, "nan")));
    assert_true(json_is_null(json_object_get(root, "inf")));
    assert_int_equal(json_integer_value(json_object_get(root, "most")), INT64_MAX);
    json_t *second = json_array_get(json_object_get(root, "list"), 1);
    assert_int_equal(json_integer_value(json_object_get(second, "i")), 1);
    json_decref(root);
}

/* Every double comes back as itself, and short ones are written short. */
static void test_numbers(void **unused)
{
    (void)unused;
    for (int i = 0; i < 20000; ++i) {
        uint64_t bits = next_random();
        double value;
        memcpy(&value, &bits, sizeof value);
        if (!isfinite(value)) {
            continue;
        }
        json_text j = {0};
        json_text_open(&j, NULL, '[');
        json_text_number(&j, NULL, value);
        json_text_number(&j, NULL, (double)(float)(bits % 100000) / 64.0);
        json_text_close(&j, ']');
        json_t *root = parse(&j);
        assert_true(json_number_value(json_array_get(root, 0)) == value);
        assert_true(json_number_value(json_array_get(root, 1)) ==
                    (double)(float)(bits % 100000) / 64.0);
        json_decref(root);
    }
    json_text j = {0};
    json_text_number(&j, NULL, 0.1);
    assert_int_equal(j.used, 3);
    assert_memory_equal(j.text, "0.1", 3);
    json_text_free(&j);
}

static void assert_text(const char *in, const char *out)
{
    json_text j = {0};
    json_text_string(&j, NULL, in);
    json_t *root = parse(&j);
    assert_int_equal(json_string_length(root), strlen(out));
    assert_string_equal(json_string_value(root), out);
    json_decref(root);
}

static void test_strings(void **unused)
{
    (void)unused;
    assert_text("", "");
    assert_text("plain / \"quoted\" \\ \x01\x1f\n\t\x7f", "plain / \"quoted\" \\ \x01\x1f\n\t\x7f");
    assert_text("Mauerst\xC3\xBC"
                "ck \xE2\x82\xAC \xF0\x9F\x8F\xA0",
                "Mauerst\xC3\xBC"
                "ck \xE2\x82\xAC \xF0\x9F\x8F\xA0");
    assert_text("latin \xFC.", "latin \xEF\xBF\xBD.");
    assert_text("\xC0\x80", "\xEF\xBF\xBD\xEF\xBF\xBD");                 /* not the shortest form */
    assert_text("\xED\xA0\x80", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"); /* half a pair */
    assert_text("cut \xE2\x82", "cut \xEF\xBF\xBD\xEF\xBF\xBD");
    for (int i = 0; i < 20000; ++i) {
        char bytes[12];
        for (int b = 0; b < 11; ++b) {
            uint64_t r = next_random();
            bytes[b] = (char)((r & 0x300) ? r | 0x80 : r);
        }
        bytes[11] = '\0';
        json_text j = {0};
        json_text_string(&j, NULL, bytes);
        json_decref(parse(&j)); /* the parser refuses what is no UTF-8 */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_strings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
