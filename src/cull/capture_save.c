/* Writing a captured frame: umb_capture_save(). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/checksum.h"
#include "base/scratch.h"
#include "capture_format.h"
#include "culler.h"
#include "index/index_name.h"
#include "index/tree.h"
#include "umbrage/capture.h"

/* What is saved, and the bytes it goes to. */
typedef struct saver {
    const umb_culler *culler;
    const umb_scene *scene;
    const umb_committed *committed;
    const umb_tree *tree;
    const umb_view *view;
    const uint32_t *answer;
    uint32_t answer_count;
    const uint32_t *candidates; /* bits, or NULL */
    uint32_t candidate_count;
    uint32_t *movers;           /* numbers of those that are in use, ascending */
    uint32_t *mover_numbers;    /* of each number, its place in that list */
    const umb_posed **poses;    /* that are known, by object */
    uint32_t mover_count, pose_count;
    const umb_mesh **meshes; /* all that objects and occluders name, by first use */
    uint32_t mesh_count;
    uint32_t *table; /* hash table of mesh numbers */
    size_t table_size;
    uint64_t counts[UMB_CAPTURE_SECTION_COUNT];
    uint64_t offsets[UMB_CAPTURE_SECTION_COUNT];
    uint64_t size;
    uint8_t *at;
} saver;

static void put(saver *s, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; ++i) {
        *s->at++ = (uint8_t)(value >> (8 * i));
    }
}

static void put_word(saver *s, uint32_t value)
{
    put(s, value, 4);
}

static void put_float(saver *s, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(s, bits, 4);
}

static void put_doubles(saver *s, const double *values, int count)
{
    for (int i = 0; i < count; ++i) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put(s, bits, 8);
    }
}

/* The slot of a mesh in the hash table: its own, or the empty one where it belongs. */
static size_t find_mesh(const saver *s, const umb_mesh *mesh)
{
    size_t slot = (size_t)(((uintptr_t)mesh >> 6) * 0x9E3779B97F4A7C15u >> 20) & (s->table_size - 1);
    while (s->table[slot] != UMB_NONE && s->meshes[s->table[slot]] != mesh) {
        slot = (slot + 1) & (s->table_size - 1);
    }
    return slot;
}

static void add_mesh(saver *s, const umb_mesh *mesh)
{
    size_t slot = mesh != NULL ? find_mesh(s, mesh) : 0;
    if (mesh != NULL && s->table[slot] == UMB_NONE) {
        s->table[slot] = s->mesh_count;
        s->meshes[s->mesh_count++] = mesh;
        s->counts[UMB_CAPTURE_POSITIONS] += mesh->position_count;
        s->counts[UMB_CAPTURE_TRIANGLES] += mesh->seen_count;
    }
}

static bool gather_meshes(saver *s, umb_scratch *scratch)
{
    const umb_committed *c = s->committed;
    size_t most = (size_t)c->object_count + (c->occluder_count - c->first_free_occluder);
    s->table_size = 16;
    while (s->table_size < 2 * most) {
        s->table_size *= 2;
    }
    s->table = umb_scratch_get(scratch, s->table_size, sizeof *s->table);
    s->meshes = umb_scratch_get(scratch, most, sizeof *s->meshes);
    if (scratch->failed) {
        return false;
    }
    memset(s->table, 0xFF, s->table_size * sizeof *s->table);
    for (uint32_t i = 0; i < c->object_count; ++i) {
        add_mesh(s, c->objects[i].mesh);
    }
    for (uint32_t i = c->first_free_occluder; i < c->occluder_count; ++i) {
        add_mesh(s, c->occluders[i].mesh);
    }
    return true;
}

static int by_object(const void *a, const void *b)
{
    uint32_t x = (*(const umb_posed *const *)a)->object, y = (*(const umb_posed *const *)b)->object;
    return (x > y) - (x < y);
}

static bool gather_movers(saver *s, umb_scratch *scratch)
{
    const umb_motion *m = &s->committed->motion;
    uint32_t told;
    const umb_posed *posed = umb_culler_posed(s->culler, &told);
    s->movers = umb_scratch_get(scratch, m->number_count, sizeof *s->movers);
    s->mover_numbers = umb_scratch_get(scratch, m->number_count, sizeof *s->mover_numbers);
    s->poses = umb_scratch_get(scratch, told, sizeof *s->poses);
    if (scratch->failed) {
        return false;
    }
    for (uint32_t i = 0; i < m->number_count; ++i) {
        s->mover_numbers[i] = s->mover_count;
        if (m->objects[i] != UMB_NONE) {
            s->movers[s->mover_count++] = i;
        }
    }
    for (uint32_t i = 0; i < told && s->mover_count > 0; ++i) {
        if (posed[i].known) {
            s->poses[s->pose_count++] = &posed[i];
        }
    }
    qsort(s->poses, s->pose_count, sizeof *s->poses, by_object);
    return true;
}

static void lay_out(saver *s)
{
    s->counts[UMB_CAPTURE_FRAME] = 1;
    s->counts[UMB_CAPTURE_MESHES] = s->mesh_count;
    s->counts[UMB_CAPTURE_FLAGS] = s->counts[UMB_CAPTURE_TRIANGLES];
    s->counts[UMB_CAPTURE_OBJECTS] = s->committed->object_count;
    s->counts[UMB_CAPTURE_OCCLUDERS] = s->committed->occluder_count -
                                       s->committed->first_free_occluder;
    s->counts[UMB_CAPTURE_NODES] = s->tree->node_count;
    s->counts[UMB_CAPTURE_BOXES] = s->tree->several ? s->tree->node_count : 0;
    s->candidates = umb_culler_candidates(s->culler, &s->candidate_count);
    s->counts[UMB_CAPTURE_CANDIDATES] = s->candidates != NULL ? ((uint64_t)s->committed->object_count + 31) / 32 : 0;
    s->counts[UMB_CAPTURE_MOVERS] = s->mover_count;
    s->counts[UMB_CAPTURE_EXPIRIES] = s->committed->motion.expiry_count;
    s->counts[UMB_CAPTURE_EXACT] = s->committed->motion.exact_count;
    s->counts[UMB_CAPTURE_POSES] = s->pose_count;
    s->counts[UMB_CAPTURE_ANSWER] = s->answer_count;
    s->size = UMB_CAPTURE_HEADER;
    for (int k = 0; k < UMB_CAPTURE_SECTION_COUNT; ++k) {
        s->offsets[k] = umb_capture_align(s->size);
        s->size = s->offsets[k] + s->counts[k] * umb_capture_record_bytes(k);
    }
}

static void put_frame(saver *s)
{
    const umb_view *v = s->view;
    const umb_index_def index = umb_index_settings(umb_culler_index(s->culler));
    put_doubles(s, umb_scene_origin(s->scene), 3);
    put_doubles(s, v->eye, 3);
    put_doubles(s, v->right, 3);
    put_doubles(s, v->up, 3);
    put_doubles(s, v->forward, 3);
    put_doubles(s, v->vertical, 3);
    const double numbers[8] = {v->x_min,      v->x_max,     v->y_min,      v->y_max,
                               v->near_depth, v->far_depth, v->min_pixels, v->time};
    put_doubles(s, numbers, 8);
    for (uint32_t i = 0; i < UMB_MAX_CLIP_PLANES; ++i) {
        static const double none[4] = {0, 0, 0, 0};
        put_doubles(s, i < v->plane_count ? v->planes[i] : none, 4);
    }
    put_doubles(s, &s->committed->motion.time, 1);
    uint32_t marks = (v->mask_all ? UMB_CAPTURE_MASK_ALL : 0u) | (v->masked_hide ? UMB_CAPTURE_MASKED_HIDE : 0u);
    const uint32_t words[10] = {(uint32_t)umb_culler_settings(s->culler).method,
                               umb_index_name_pack(&index),
                               (uint32_t)v->projection,
                               v->width,
                               v->height,
                               v->buffer_width,
                               v->buffer_height,
                               v->plane_count,
                               v->mask,
                               marks};
    for (int i = 0; i < 10; ++i) {
        put_word(s, words[i]);
    }
}

static void put_meshes(saver *s, uint8_t *bytes)
{
    for (uint32_t m = 0; m < s->mesh_count; ++m) {
        put_word(s, s->meshes[m]->position_count);
        put_word(s, s->meshes[m]->seen_count);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_POSITIONS];
    for (uint32_t m = 0; m < s->mesh_count; ++m) {
        for (uint32_t i = 0; i < 3 * s->meshes[m]->position_count; ++i) {
            put_float(s, s->meshes[m]->positions[i / 3][i % 3]);
        }
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_TRIANGLES];
    for (uint32_t m = 0; m < s->mesh_count; ++m) {
        for (uint64_t i = 0; i < 3 * (uint64_t)s->meshes[m]->seen_count; ++i) {
            put_word(s, s->meshes[m]->triangles[i / 3][i % 3]);
        }
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_FLAGS];
    for (uint32_t m = 0; m < s->mesh_count; ++m) {
        const umb_mesh *mesh = s->meshes[m];
        for (uint32_t t = 0; t < mesh->seen_count; ++t) {
            bool blocks = t < mesh->triangle_count;
            put(s,
                !blocks              ? UMB_TRIANGLE_OPEN
                : mesh->two_sided[t] ? UMB_TRIANGLE_TWO_SIDED
                                     : 0,
                1);
        }
    }
}

static void put_transform(saver *s, const umb_transform *t)
{
    for (int i = 0; i < 12; ++i) {
        put_float(s, t->m[i / 4][i % 4]);
    }
}

static void put_boxes(saver *s, const umb_node *node)
{
    for (int i = 0; i < 6; ++i) {
        for (int slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
            put_float(s, i < 3 ? node->min[i][slot] : node->max[i - 3][slot]);
        }
    }
}

static void put_box(saver *s, const umb_aabb *box)
{
    for (int k = 0; k < 6; ++k) {
        put_float(s, k < 3 ? box->min[k] : box->max[k - 3]);
    }
}

static void put_objects(saver *s, uint8_t *bytes)
{
    const umb_committed *c = s->committed;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        const umb_object *o = &c->objects[i];
        put_box(s, &o->bounds);
        put_transform(s, &o->transform);
        put_word(s, o->mesh != NULL ? s->table[find_mesh(s, o->mesh)] : UMB_NONE);
        put_word(s, (o->used ? UMB_CAPTURE_USED : 0u) | (o->live ? UMB_CAPTURE_LIVE : 0u) |
                        (o->refine ? UMB_CAPTURE_IS_SHAPE : 0u) |
                        (o->occluder != UMB_NONE ? UMB_CAPTURE_HIDES : 0u));
        put_word(s, o->mask);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_OCCLUDERS];
    for (uint32_t i = c->first_free_occluder; i < c->occluder_count; ++i) {
        put_transform(s, &c->occluders[i].transform);
        put_word(s, s->table[find_mesh(s, c->occluders[i].mesh)]);
        put_word(s, c->occluder_masks[i]);
    }
}

/* Of all objects; those beyond the set are none. */
static void put_candidates(saver *s)
{
    uint32_t objects = s->committed->object_count, count = s->candidate_count < objects ? s->candidate_count : objects;
    for (uint32_t i = 0; i < s->counts[UMB_CAPTURE_CANDIDATES]; ++i) {
        uint32_t first = 32 * i, left = count > first ? count - first : 0;
        uint32_t known = left >= 32 ? ~0u : (1u << left) - 1u;
        put_word(s, left > 0 ? s->candidates[i] & known : 0);
    }
}

static void put_motion(saver *s, uint8_t *bytes)
{
    const umb_motion *m = &s->committed->motion;
    s->at = bytes + s->offsets[UMB_CAPTURE_MOVERS];
    for (uint32_t i = 0; i < s->mover_count; ++i) {
        uint32_t object = m->objects[s->movers[i]];
        put_word(s, object);
        put_word(s, (s->committed->objects[object].exact ? UMB_CAPTURE_EXACT_MOVER : 0u) |
                        (umb_scene_is_fuzzy(s->scene, s->movers[i]) ? UMB_CAPTURE_FUZZY : 0u));
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_EXPIRIES];
    for (uint32_t i = 0; i < m->expiry_count; ++i) {
        put_doubles(s, &m->expiries[i].until, 1);
        put_word(s, s->mover_numbers[m->expiries[i].mover]);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_EXACT];
    for (uint32_t i = 0; i < m->exact_count; ++i) {
        put_word(s, s->mover_numbers[m->exact[i]]);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_POSES];
    for (uint32_t i = 0; i < s->pose_count; ++i) {
        put_word(s, s->poses[i]->object);
        put_transform(s, &s->poses[i]->pose.transform);
        put_box(s, &s->poses[i]->pose.bounds);
    }
}

static void put_all(saver *s, uint8_t *bytes)
{
    memset(bytes, 0, (size_t)s->size);
    s->at = bytes + UMB_CAPTURE_TABLE;
    for (int k = 0; k < UMB_CAPTURE_SECTION_COUNT; ++k) {
        put(s, s->offsets[k], 8);
        put(s, s->counts[k], 8);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_FRAME];
    put_frame(s);
    s->at = bytes + s->offsets[UMB_CAPTURE_MESHES];
    put_meshes(s, bytes);
    s->at = bytes + s->offsets[UMB_CAPTURE_OBJECTS];
    put_objects(s, bytes);
    s->at = bytes + s->offsets[UMB_CAPTURE_NODES];
    for (uint32_t n = 0; n < s->tree->node_count; ++n) {
        for (uint32_t k = 0; k < UMB_NODE_WIDTH; ++k) {
            put_word(s, k < s->tree->nodes[n].count ? s->tree->nodes[n].ref[k] : UMB_NONE);
        }
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_BOXES];
    for (uint32_t n = 0; n < s->counts[UMB_CAPTURE_BOXES]; ++n) {
        put_boxes(s, &s->tree->nodes[n]);
    }
    s->at = bytes + s->offsets[UMB_CAPTURE_CANDIDATES];
    put_candidates(s);
    put_motion(s, bytes);
    s->at = bytes + s->offsets[UMB_CAPTURE_ANSWER];
    for (uint32_t i = 0; i < s->answer_count; ++i) {
        put_word(s, s->answer[i]);
    }
    uint64_t sum = umb_checksum(bytes + UMB_CAPTURE_TABLE, (size_t)s->size - UMB_CAPTURE_TABLE);
    s->at = bytes;
    memcpy(s->at, UMB_CAPTURE_MAGIC, 8);
    s->at += 8;
    put_word(s, UMB_CAPTURE_VERSION);
    put_word(s, UMB_CAPTURE_HEADER);
    put(s, s->size, 8);
    put(s, sum, 8);
}

umb_result umb_capture_save(const umb_culler *culler, void *bytes, size_t capacity, size_t *size)
{
    *size = 0;
    saver s = {.culler = culler};
    s.view = umb_culler_last_view(culler, &s.answer, &s.answer_count);
    if (s.view == NULL) {
        return umb_error_set(
            umb_culler_settings(culler).error, UMB_ERROR_STATE,
            "nothing to capture: no view has been answered since the scene or the candidates changed");
    }
    const umb_index *index = umb_culler_index(culler);
    s.scene = umb_index_scene(index);
    s.committed = umb_scene_committed(s.scene);
    s.tree = umb_index_tree(index);
    if (!isfinite(s.committed->motion.time)) {
        return umb_error_set(umb_culler_settings(culler).error, UMB_ERROR_STATE,
                             "nothing to capture: the last commit failed; commit again");
    }
    umb_scratch scratch = {.allocator = umb_scene_allocator(s.scene)};
    umb_result result = UMB_OK;
    if (!gather_meshes(&s, &scratch) || !gather_movers(&s, &scratch)) {
        result = umb_error_set(umb_culler_settings(culler).error, UMB_ERROR_MEMORY,
                               "no memory for a capture");
    } else {
        lay_out(&s);
        *size = (size_t)s.size;
        if (bytes != NULL && capacity < s.size) {
            result = umb_error_set(umb_culler_settings(culler).error, UMB_ERROR_ARGUMENT,
                                   "a capture needs %llu bytes", (unsigned long long)s.size);
        } else if (bytes != NULL) {
            put_all(&s, bytes);
        }
    }
    umb_scratch_free(&scratch);
    return result;
}
