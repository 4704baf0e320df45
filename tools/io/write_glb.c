#include "write_glb.h"

#include <string.h>

#include "model_parts.h"
#include "output.h"

/* The JSON is written as it comes and its length filled in afterwards: a city has a million
 * nodes. */
typedef struct glb_writer {
    const model *m;
    FILE *f;
    uint64_t bytes;   /* of the binary chunk */
    bool needs_point; /* some object has no mesh */
} glb_writer;

enum { MATERIALS = 4 }; /* numbered by their UMB_TRIANGLE_* bits */

static uint32_t mesh_material(const model_mesh *mesh)
{
    uint32_t any = 0, all = UMB_TRIANGLE_TWO_SIDED;
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        any |= mesh->flags[t];
        all &= mesh->flags[t];
    }
    return (any & UMB_TRIANGLE_OPEN) | (mesh->triangle_count ? all & UMB_TRIANGLE_TWO_SIDED : 0u);
}

/* Length of the well-formed UTF-8 sequence at s; 0 if there is none. */
static size_t sequence_length(const uint8_t *s)
{
    size_t n = s[0] < 0x80                   ? 1
               : s[0] >= 0xC2 && s[0] < 0xE0 ? 2
               : s[0] >= 0xE0 && s[0] < 0xF0 ? 3
               : s[0] >= 0xF0 && s[0] < 0xF5 ? 4
                                             : 0;
    for (size_t k = 1; k < n; ++k) {
        if ((s[k] & 0xC0) != 0x80) {
            return 0;
        }
    }
    bool surrogate = s[0] == 0xED && s[1] >= 0xA0;
    bool too_long = (s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xF0 && s[1] < 0x90);
    bool too_large = s[0] == 0xF4 && s[1] >= 0x90;
    return n > 1 && (surrogate || too_long || too_large) ? 0 : n;
}

/* Names of old files are in any encoding: what is no UTF-8 becomes a question mark. */
static void write_string(FILE *f, const char *text)
{
    const uint8_t *s = (const uint8_t *)text;
    fputc('"', f);
    while (*s) {
        size_t n = sequence_length(s);
        if (n == 0) {
            fputc('?', f);
            n = 1;
        } else if (n > 1) {
            fwrite(s, 1, n, f);
        } else if (*s < 0x20 || *s == 0x7F) {
            fprintf(f, "\\u%04x", *s);
        } else {
            if (*s == '"' || *s == '\\') {
                fputc('\\', f);
            }
            fputc(*s, f);
        }
        s += n;
    }
    fputc('"', f);
}

/* Nine digits name a float; what reads them as double and narrows gets it back. */
static void write_node(const glb_writer *w, const model_object *o)
{
    const float(*m)[4] = o->transform.m;
    static const float identity[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    bool turned = false, moved = false;
    for (int i = 0; i < 3; ++i) {
        turned = turned || memcmp(m[i], identity[i], sizeof identity[i]) != 0;
        moved = moved || m[i][3] != 0.0f;
    }
    fputs("{\"name\":", w->f);
    write_string(w->f, o->name);
    fprintf(w->f, ",\"mesh\":%u", o->mesh == MODEL_NONE ? w->m->mesh_count : o->mesh);
    if (turned) {
        fputs(",\"matrix\":[", w->f);
        for (int k = 0; k < 16; ++k) {
            double value = k % 4 < 3 ? (double)m[k % 4][k / 4] : k == 15;
            fprintf(w->f, "%s%.9g", k ? "," : "", value);
        }
        fputc(']', w->f);
    } else if (moved) {
        fprintf(w->f, ",\"translation\":[%.9g,%.9g,%.9g]", m[0][3], m[1][3], m[2][3]);
    }
    fputc('}', w->f);
}

static void write_nodes(const glb_writer *w)
{
    const model *m = w->m;
    bool root = m->origin[0] != 0.0 || m->origin[1] != 0.0 || m->origin[2] != 0.0;
    fputs("\"scenes\":[{\"nodes\":[", w->f);
    for (uint32_t o = 0; o < (root ? 1 : m->object_count); ++o) {
        fprintf(w->f, "%s%u", o ? "," : "", root ? m->object_count : o);
    }
    fputs("]}],\"nodes\":[", w->f);
    for (uint32_t o = 0; o < m->object_count; ++o) {
        fputs(o ? ",\n" : "\n", w->f);
        write_node(w, &m->objects[o]);
    }
    if (root) {
        fprintf(w->f, ",\n{\"name\":\"origin\",\"translation\":[%.17g,%.17g,%.17g],\"children\":[",
                m->origin[0], m->origin[1], m->origin[2]);
        for (uint32_t o = 0; o < m->object_count; ++o) {
            fprintf(w->f, "%s%u", o ? "," : "", o);
        }
        fputs("]}", w->f);
    }
    fputs("],\n", w->f);
}

/* Accessors 2k and 2k + 1 are the positions and indices of mesh k. One mesh more, a single
 * point, stands for objects without triangles, so that they keep their numbers. */
static void write_meshes(const glb_writer *w)
{
    fputs("\"meshes\":[", w->f);
    for (uint32_t k = 0; k < w->m->mesh_count; ++k) {
        fprintf(w->f,
                "%s\n{\"primitives\":[{\"attributes\":{\"POSITION\":%u},\"indices\":%u,"
                "\"material\":%u}]}",
                k ? "," : "", 2 * k, 2 * k + 1, mesh_material(&w->m->meshes[k]));
    }
    if (w->needs_point) {
        fprintf(
            w->f,
            "%s\n{\"primitives\":[{\"attributes\":{\"POSITION\":%u},\"mode\":0,\"material\":0}]}",
            w->m->mesh_count ? "," : "", 2 * w->m->mesh_count);
    }
    fputs("],\n\"materials\":[", w->f);
    for (uint32_t k = 0; k < MATERIALS; ++k) {
        fprintf(w->f, "%s{\"alphaMode\":\"%s\",\"doubleSided\":%s}", k ? "," : "",
                k & UMB_TRIANGLE_OPEN ? "BLEND" : "OPAQUE",
                k & UMB_TRIANGLE_TWO_SIDED ? "true" : "false");
    }
    fputs("],\n", w->f);
}

static void write_positions_accessor(FILE *f, uint64_t offset, const float *p, uint32_t count)
{
    float low[3] = {p[0], p[1], p[2]}, high[3] = {p[0], p[1], p[2]};
    for (uint32_t v = 1; v < count; ++v) {
        for (int i = 0; i < 3; ++i) {
            float x = p[3 * (size_t)v + (size_t)i];
            low[i] = x < low[i] ? x : low[i];
            high[i] = x > high[i] ? x : high[i];
        }
    }
    fprintf(f,
            "\n{\"bufferView\":0,\"byteOffset\":%llu,\"componentType\":5126,\"type\":\"VEC3\","
            "\"count\":%u,"
            "\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]}",
            (unsigned long long)offset, count, low[0], low[1], low[2], high[0], high[1], high[2]);
}

static void write_accessors(glb_writer *w)
{
    static const float point[3] = {0, 0, 0};
    fputs("\"accessors\":[", w->f);
    for (uint32_t k = 0; k < w->m->mesh_count; ++k) {
        const model_mesh *mesh = &w->m->meshes[k];
        fputs(k ? "," : "", w->f);
        write_positions_accessor(w->f, w->bytes, mesh->positions, mesh->position_count);
        w->bytes += 12 * (uint64_t)mesh->position_count;
        fprintf(
            w->f,
            ",\n{\"bufferView\":0,\"byteOffset\":%llu,\"componentType\":5125,\"type\":\"SCALAR\","
            "\"count\":%u}",
            (unsigned long long)w->bytes, 3 * mesh->triangle_count);
        w->bytes += 12 * (uint64_t)mesh->triangle_count;
    }
    if (w->needs_point) {
        fputs(w->m->mesh_count ? "," : "", w->f);
        write_positions_accessor(w->f, w->bytes, point, 1);
        w->bytes += sizeof point;
    }
    fprintf(w->f,
            "],\n\"bufferViews\":[{\"buffer\":0,\"byteLength\":%llu}],"
            "\"buffers\":[{\"byteLength\":%llu}]}",
            (unsigned long long)w->bytes, (unsigned long long)w->bytes);
}

static void write_word(FILE *f, uint32_t word)
{
    const uint8_t bytes[4] = {(uint8_t)word, (uint8_t)(word >> 8), (uint8_t)(word >> 16),
                              (uint8_t)(word >> 24)};
    fwrite(bytes, 1, sizeof bytes, f);
}

/* Floats and indices are four bytes each; written through words so that every machine writes
 * alike. */
static void write_words(FILE *f, const void *words, uint64_t count)
{
    const uint8_t *at = words;
    for (uint64_t k = 0; k < count; ++k) {
        uint32_t word;
        memcpy(&word, at + 4 * k, sizeof word);
        write_word(f, word);
    }
}

static bool write_chunks(glb_writer *w, const char *file, umb_error *error)
{
    enum { HEADER = 12, CHUNK = 8 };
    static const uint8_t magic[4] = {'g', 'l', 'T', 'F'}, json_type[4] = {'J', 'S', 'O', 'N'},
                         binary_type[4] = {'B', 'I', 'N', 0};
    fseeko(w->f, HEADER + CHUNK, SEEK_SET);
    fputs("{\"asset\":{\"version\":\"2.0\",\"generator\":\"umbrage\"},\"scene\":0,\n", w->f);
    write_nodes(w);
    write_meshes(w);
    write_accessors(w);
    off_t end = ftello(w->f);
    for (; end % 4 != 0; ++end) {
        fputc(' ', w->f);
    }
    uint64_t total = (uint64_t)end + CHUNK + w->bytes;
    if (end < 0 || total > UINT32_MAX) {
        return model_fail(
            error, UMB_ERROR_LIMIT,
            "%.150s: the scene needs more than the 4 GB of a GLB file; write a smaller one", file);
    }
    write_word(w->f, (uint32_t)w->bytes);
    fwrite(binary_type, 1, 4, w->f);
    for (uint32_t k = 0; k < w->m->mesh_count; ++k) {
        const model_mesh *mesh = &w->m->meshes[k];
        write_words(w->f, mesh->positions, 3 * (uint64_t)mesh->position_count);
        write_words(w->f, mesh->indices, 3 * (uint64_t)mesh->triangle_count);
    }
    for (int k = 0; w->needs_point && k < 3; ++k) {
        write_word(w->f, 0);
    }
    rewind(w->f);
    fwrite(magic, 1, 4, w->f);
    write_word(w->f, 2);
    write_word(w->f, (uint32_t)total);
    write_word(w->f, (uint32_t)(end - HEADER - CHUNK));
    fwrite(json_type, 1, 4, w->f);
    return true;
}

bool write_glb(const model *m, const char *file, umb_error *error)
{
    glb_writer w = {.m = m};
    for (uint32_t o = 0; o < m->object_count; ++o) {
        w.needs_point = w.needs_point || m->objects[o].mesh == MODEL_NONE;
    }
    if (m->object_count == 0) {
        return model_fail(error, UMB_ERROR_ARGUMENT,
                          "%.150s: no object to write; choose another scene", file);
    }
    w.f = output_open(file, error);
    return w.f && output_close(w.f, file, write_chunks(&w, file, error), error);
}
