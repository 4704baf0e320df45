#include "texture_alpha.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct texture_answer {
    char *name;
    bool alpha;
} texture_answer;

/* Pictures of more pixels are taken at their header's word. */
#define PIXEL_LIMIT (1u << 26)

static bool png_has_alpha(const char *path)
{
    png_image image;
    memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&image, path)) {
        return false;
    }
    if ((image.format & PNG_FORMAT_FLAG_ALPHA) == 0) {
        png_image_free(&image);
        return false;
    }
    size_t pixels = (size_t)image.width * image.height;
    image.format = PNG_FORMAT_RGBA;
    uint8_t *decoded = pixels <= PIXEL_LIMIT ? malloc(4 * pixels + 1) : NULL;
    if (decoded == NULL || !png_image_finish_read(&image, NULL, decoded, 0, NULL)) {
        png_image_free(&image);
        free(decoded);
        return true;
    }
    bool alpha = false;
    for (size_t i = 0; i < pixels && !alpha; ++i) {
        alpha = decoded[4 * i + 3] != 255;
    }
    free(decoded);
    return alpha;
}

/* What the first bytes say of formats that are not decoded here. */
static bool header_has_alpha(const char *path)
{
    uint8_t head[128] = {0};
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    size_t size = fread(head, 1, sizeof head, file);
    fclose(file);
    if (size >= 12 && head[0] == 0x01 && head[1] == 0xDA) { /* SGI: two or four channels */
        return head[11] == 2 || head[11] == 4;
    }
    if (size >= 128 && memcmp(head, "DDS ", 4) == 0) {
        /* Bits of alpha, or a compression that has them. */
        return (head[80] & 1) != 0 || (memcmp(head + 84, "DXT", 3) == 0 && head[87] != '1');
    }
    const char *dot = strrchr(path, '.');
    bool tga = dot != NULL && (strcmp(dot, ".tga") == 0 || strcmp(dot, ".TGA") == 0);
    return tga && size >= 18 && ((head[17] & 15) != 0 || head[16] == 32);
}

/* The texture's path, from the folder of the scene. */
static char *beside_scene(const char *scene, const char *texture)
{
    const char *slash = strrchr(scene, '/');
    size_t folder = slash != NULL && texture[0] != '/' ? (size_t)(slash - scene) + 1 : 0;
    char *path = malloc(folder + strlen(texture) + 1);
    if (path != NULL) {
        memcpy(path, scene, folder);
        strcpy(path + folder, texture);
        for (char *c = path + folder; *c != '\0'; ++c) {
            *c = *c == '\\' ? '/' : *c;
        }
    }
    return path;
}

bool texture_has_alpha(texture_alphas *known, const char *scene, const char *texture)
{
    for (uint32_t i = 0; i < known->count; ++i) {
        if (strcmp(known->answers[i].name, texture) == 0) {
            return known->answers[i].alpha;
        }
    }
    char *path = beside_scene(scene, texture);
    if (path == NULL) {
        return true;
    }
    bool alpha = png_has_alpha(path) || header_has_alpha(path);
    free(path);
    texture_answer *grown = realloc(known->answers, (known->count + 1) * sizeof *grown);
    if (grown != NULL) {
        known->answers = grown;
        texture_answer answer = {malloc(strlen(texture) + 1), alpha};
        if (answer.name != NULL) {
            strcpy(answer.name, texture);
            grown[known->count++] = answer;
        }
    }
    return alpha;
}

void texture_alphas_free(texture_alphas *known)
{
    for (uint32_t i = 0; i < known->count; ++i) {
        free(known->answers[i].name);
    }
    free(known->answers);
    known->answers = NULL;
    known->count = 0;
}
