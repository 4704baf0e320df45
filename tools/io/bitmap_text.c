/* Text on pictures, by stb_easy_font: letters of axis-aligned quadrilaterals. */
#include "bitmap.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_easy_font.h>
#pragma GCC diagnostic pop

/* The font wants writable text and draws what is not ASCII as garbage. */
static void copy_ascii(char *to, size_t size, const char *text)
{
    size_t k = 0;
    for (; text[k] && k + 1 < size; ++k) {
        to[k] = (text[k] >= 32 && text[k] < 127) || text[k] == '\n' ? text[k] : '?';
    }
    to[k] = 0;
}

void bitmap_text(bitmap *im, int x, int y, int scale, const char *text, bitmap_color color)
{
    enum { LONGEST = 160, VERTEX = 4, QUAD = 4 * VERTEX, QUADS_A_LETTER = 12 };
    char copy[LONGEST];
    float quads[LONGEST * QUADS_A_LETTER * QUAD];
    copy_ascii(copy, sizeof copy, text);
    int count = stb_easy_font_print(0, 0, copy, NULL, quads, (int)sizeof quads);
    for (int k = 0; k < count; ++k) {
        const float *a = quads + k * QUAD, *c = a + 2 * VERTEX;
        bitmap_rectangle(im, x + (int)a[0] * scale, y + (int)a[1] * scale,
                         (int)(c[0] - a[0]) * scale, (int)(c[1] - a[1]) * scale, color, 1.0);
    }
}

int bitmap_text_width(const char *text, int scale)
{
    char copy[160];
    copy_ascii(copy, sizeof copy, text);
    return stb_easy_font_width(copy) * scale;
}

int bitmap_text_height(int scale)
{
    return 12 * scale;
}
