/* Reading a captured frame: umb_capture_load(). Nothing in the block is believed before it is
 * checked: a checksum keeps accidents out, not malice. */
#include <string.h>

#include "base/checksum.h"
#include "base/scratch.h"
#include "capture_format.h"
#include "culler.h"
#include "index/index_name.h"
#include "index/tree.h"
#include "scene/motion_restore.h"
#include "umbrage/capture.h"

/* A pose that was told for the frame. */
typedef struct stored_pose {
    uint32_t object;
    umb_transform transform;
    umb_aabb bounds;
} stored_pose;

/* What the callback of the loaded scene looks at; it begins the capture's block. */
typedef struct pose_table {
    stored_pose *poses; /* by object */
    uint32_t count;
} pose_table;

typedef struct loader {
    const uint8_t *bytes;
    uint64_t size;
    const uint8_t *sections[UMB_CAPTURE_SECTION_COUNT];
    uint32_t counts[UMB_CAPTURE_SECTION_COUNT];
    const uint8_t *at;
    double origin[3], time; /* of the scene */
    pose_table *poses;
    umb_shape *shapes;
    umb_tasks tasks;
    umb_isa isa;
    umb_capture *out;
    umb_error *error;
} loader;

static uint64_t get(const uint8_t *p, int bytes)
{
    uint64_t x = 0;
    for (int i = bytes - 1; i >= 0; --i) {
        x = x << 8 | p[i];
    }
    return x;
}

static uint32_t get_word(loader *l)
{
    l->at += 4;
    return (uint32_t)get(l->at - 4, 4);
}

static float get_float(loader *l)
{
    uint32_t bits = get_word(l);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void get_doubles(loader *l, double *out, int count)
{
    for (int i = 0; i < count; ++i) {
        uint64_t bits = get(l->at, 8);
        memcpy(&out[i], &bits, sizeof out[i]);
        l->at += 8;
    }
}

static umb_result fail(const loader *l, const char *what)
{
    return umb_error_set(l->error, UMB_ERROR_FORMAT, "capture: %s", what);
}

/* What a call on stored data answered: a broken rule of the call is a broken file. */
static umb_result fail_call(const loader *l, umb_result result, const char *what)
{
    if (result == UMB_ERROR_MEMORY) {
        return umb_error_set(l->error, result, "capture: no memory for its %s", what);
    }
    return umb_error_set(l->error, UMB_ERROR_FORMAT, "capture: its %s break the rules", what);
}

static umb_result check_header(loader *l)
{
    if (l->bytes == NULL || l->size < UMB_CAPTURE_HEADER ||
        memcmp(l->bytes, UMB_CAPTURE_MAGIC, 8) != 0) {
        return fail(l, "no captured frame");
    }
    uint32_t version = (uint32_t)get(l->bytes + 8, 4);
    if (version != UMB_CAPTURE_VERSION) {
        return umb_error_set(l->error, UMB_ERROR_VERSION,
                             "capture: version %u, this library reads %u", version,
                             UMB_CAPTURE_VERSION);
    }
    if (get(l->bytes + 12, 4) != UMB_CAPTURE_HEADER || get(l->bytes + 16, 8) != l->size) {
        return fail(l, "cut short, or not its own size");
    }
    if (get(l->bytes + 24, 8) !=
        umb_checksum(l->bytes + UMB_CAPTURE_TABLE, (size_t)l->size - UMB_CAPTURE_TABLE)) {
        return fail(l, "damaged: the checksum differs");
    }
    return UMB_OK;
}

/* Sections lie where the writer puts them, so their places say nothing but their counts. */
static umb_result check_sections(loader *l)
{
    uint64_t end = UMB_CAPTURE_HEADER;
    for (int k = 0; k < UMB_CAPTURE_SECTION_COUNT; ++k) {
        const uint8_t *entry = l->bytes + UMB_CAPTURE_TABLE + 16 * (size_t)k;
        uint64_t offset = get(entry, 8), count = get(entry + 8, 8);
        if (offset != umb_capture_align(end) || offset > l->size ||
            count > (l->size - offset) / umb_capture_record_bytes(k) || count > (1u << 30)) {
            return fail(l, "a section lies outside of it");
        }
        l->sections[k] = l->bytes + offset;
        l->counts[k] = (uint32_t)count;
        end = offset + count * umb_capture_record_bytes(k);
    }
    if (end != l->size || l->counts[UMB_CAPTURE_FRAME] != 1 ||
        l->counts[UMB_CAPTURE_FLAGS] != l->counts[UMB_CAPTURE_TRIANGLES] ||
        (l->counts[UMB_CAPTURE_BOXES] != 0 && l->counts[UMB_CAPTURE_BOXES] != l->counts[UMB_CAPTURE_NODES]) ||
        (l->counts[UMB_CAPTURE_CANDIDATES] != 0 &&
         l->counts[UMB_CAPTURE_CANDIDATES] != (l->counts[UMB_CAPTURE_OBJECTS] + 31) / 32)) {
        return fail(l, "sections that do not belong together");
    }
    return UMB_OK;
}

static umb_result read_frame(loader *l)
{
    umb_view *v = &l->out->view;
    double numbers[8];
    uint32_t words[10];
    l->at = l->sections[UMB_CAPTURE_FRAME];
    get_doubles(l, l->origin, 3);
    get_doubles(l, v->eye, 3);
    get_doubles(l, v->right, 3);
    get_doubles(l, v->up, 3);
    get_doubles(l, v->forward, 3);
    get_doubles(l, v->vertical, 3);
    get_doubles(l, numbers, 8);
    get_doubles(l, v->planes[0], 4 * UMB_MAX_CLIP_PLANES);
    get_doubles(l, &l->time, 1);
    for (int i = 0; i < 10; ++i) {
        words[i] = get_word(l);
    }
    v->x_min = numbers[0];
    v->x_max = numbers[1];
    v->y_min = numbers[2];
    v->y_max = numbers[3];
    v->near_depth = numbers[4];
    v->far_depth = numbers[5];
    v->min_pixels = numbers[6];
    v->time = numbers[7];
    if (words[0] > UMB_METHOD_OCCLUSION_TREE || !umb_index_name_unpack(words[1], &l->out->index_def) || words[2] > UMB_ORTHOGRAPHIC) {
        return fail(l, "unknown method, index or projection");
    }
    l->out->method = (umb_method)words[0];
    v->projection = (umb_projection)words[2];
    v->width = words[3];
    v->height = words[4];
    v->buffer_width = words[5];
    v->buffer_height = words[6];
    v->plane_count = words[7];
    v->mask = words[8];
    v->mask_all = (words[9] & UMB_CAPTURE_MASK_ALL) != 0;
    v->masked_hide = (words[9] & UMB_CAPTURE_MASKED_HIDE) != 0;
    if ((words[9] & ~(uint32_t)UMB_CAPTURE_VIEW_MARKS) != 0) {
        return fail(l, "unknown marks of the view");
    }
    return umb_view_check(v, NULL) == UMB_OK ? UMB_OK : fail(l, "an impossible view");
}

static umb_result read_meshes(loader *l, umb_scratch *scratch)
{
    uint32_t position_count = l->counts[UMB_CAPTURE_POSITIONS];
    uint32_t triangle_count = l->counts[UMB_CAPTURE_TRIANGLES];
    float *positions = umb_scratch_get(scratch, (size_t)position_count, 3 * sizeof *positions);
    uint32_t *indices = umb_scratch_get(scratch, (size_t)triangle_count, 3 * sizeof *indices);
    l->shapes = umb_scratch_get(scratch, l->counts[UMB_CAPTURE_MESHES], sizeof *l->shapes);
    if (scratch->failed) {
        return fail_call(l, UMB_ERROR_MEMORY, "meshes");
    }
    l->at = l->sections[UMB_CAPTURE_POSITIONS];
    for (size_t i = 0; i < 3 * (size_t)position_count; ++i) {
        positions[i] = get_float(l);
    }
    l->at = l->sections[UMB_CAPTURE_TRIANGLES];
    for (size_t i = 0; i < 3 * (size_t)triangle_count; ++i) {
        indices[i] = get_word(l);
    }
    size_t position = 0, triangle = 0;
    l->at = l->sections[UMB_CAPTURE_MESHES];
    for (uint32_t m = 0; m < l->counts[UMB_CAPTURE_MESHES]; ++m) {
        uint32_t p = get_word(l), t = get_word(l);
        if (p > position_count - position || t > triangle_count - triangle) {
            return fail(l, "a mesh larger than what is stored");
        }
        umb_shape_def def = {.positions = positions + 3 * position,
                             .position_count = p,
                             .indices = indices + 3 * triangle,
                             .index_count = 3 * t,
                             .triangle_flags = l->sections[UMB_CAPTURE_FLAGS] + triangle};
        umb_result result = umb_scene_add_shape(l->out->scene, &def, &l->shapes[m]);
        if (result != UMB_OK) {
            return fail_call(l, result, "meshes");
        }
        position += p;
        triangle += t;
    }
    return position == position_count && triangle == triangle_count
               ? UMB_OK
               : fail(l, "more triangles than meshes");
}

static umb_transform get_transform(loader *l)
{
    umb_transform t;
    for (int i = 0; i < 12; ++i) {
        t.m[i / 4][i % 4] = get_float(l);
    }
    return t;
}

static bool get_shape(loader *l, umb_shape *out)
{
    uint32_t m = get_word(l);
    *out = m < l->counts[UMB_CAPTURE_MESHES] ? l->shapes[m] : 0;
    return m == UMB_NONE || *out != 0;
}

static umb_aabb get_box(loader *l)
{
    umb_aabb box;
    for (int k = 0; k < 6; ++k) {
        *(k < 3 ? &box.min[k] : &box.max[k - 3]) = get_float(l);
    }
    return box;
}

/* An id that is free in the capture is one that was used and removed. */
static umb_result read_object(loader *l)
{
    umb_object_def def = {0};
    def.bounds = get_box(l);
    def.transform = get_transform(l);
    bool known = get_shape(l, &def.shape);
    uint32_t marks = get_word(l), id = UMB_NONE;
    def.mask = get_word(l);
    bool used = (marks & UMB_CAPTURE_USED) != 0;
    if (!known || (marks & ~(uint32_t)UMB_CAPTURE_MARKS) != 0 ||
        (!used && (marks != 0 || def.shape != 0 || def.mask != 0))) {
        return UMB_ERROR_FORMAT;
    }
    def.flags = (marks & UMB_CAPTURE_LIVE) != 0 ? 0 : UMB_OBJECT_IGNORED;
    def.flags |= (marks & UMB_CAPTURE_IS_SHAPE) != 0 ? UMB_OBJECT_IS_SHAPE : 0;
    def.flags |= (marks & UMB_CAPTURE_HIDES) != 0 ? 0 : UMB_OBJECT_NEVER_HIDES;
    umb_result result = umb_scene_add_object(l->out->scene, &def, &id);
    if (result == UMB_OK && !used) {
        result = umb_scene_remove_object(l->out->scene, id);
    }
    return result;
}

/* Only what was asked for in the frame is known. */
static bool tell_pose(void *user, uint32_t object, double time, umb_pose *out)
{
    const pose_table *t = user;
    uint32_t low = 0, high = t->count;
    (void)time;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (t->poses[middle].object < object) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low == t->count || t->poses[low].object != object) {
        return false;
    }
    out->transform = t->poses[low].transform;
    out->bounds = t->poses[low].bounds;
    return true;
}

static umb_result read_poses(loader *l)
{
    l->at = l->sections[UMB_CAPTURE_POSES];
    for (uint32_t i = 0; i < l->poses->count; ++i) {
        stored_pose *p = &l->poses->poses[i];
        p->object = get_word(l);
        p->transform = get_transform(l);
        p->bounds = get_box(l);
        if (i > 0 && p->object <= p[-1].object) {
            return fail(l, "poses in no order");
        }
    }
    return UMB_OK;
}

/* Poses and answer, which last as long as the capture. */
static umb_result read_block(loader *l)
{
    umb_allocator allocator = umb_memory_allocator(NULL);
    uint32_t count = l->counts[UMB_CAPTURE_ANSWER], poses = l->counts[UMB_CAPTURE_POSES];
    size_t size = sizeof(pose_table) + poses * sizeof(stored_pose) + count * sizeof(uint32_t);
    uint8_t *block = umb_memory_allocate(&allocator, size);
    if (block == NULL) {
        return fail_call(l, UMB_ERROR_MEMORY, "answer");
    }
    l->out->block = block;
    l->out->block_size = size;
    l->poses = (pose_table *)(void *)block;
    l->poses->poses = (stored_pose *)(void *)(block + sizeof *l->poses);
    l->poses->count = poses;
    l->out->answer = (uint32_t *)(void *)(l->poses->poses + poses);
    l->out->answer_count = count;
    l->at = l->sections[UMB_CAPTURE_ANSWER];
    for (uint32_t i = 0; i < count; ++i) {
        l->out->answer[i] = get_word(l);
        if (l->out->answer[i] >= l->counts[UMB_CAPTURE_OBJECTS]) {
            return fail(l, "an answer that names no object");
        }
    }
    return read_poses(l);
}

/* Movers, when the objects are there; and the scene's first commit. */
static umb_result read_motion(loader *l, umb_scratch *scratch)
{
    uint32_t movers = l->counts[UMB_CAPTURE_MOVERS], expiries = l->counts[UMB_CAPTURE_EXPIRIES];
    uint32_t exact = l->counts[UMB_CAPTURE_EXACT], marks = 0;
    umb_stored_mover *stored = umb_scratch_get(scratch, movers, sizeof *stored);
    umb_expiry *queue = umb_scratch_get(scratch, expiries, sizeof *queue);
    uint32_t *list = umb_scratch_get(scratch, exact, sizeof *list);
    if (scratch->failed) {
        return UMB_ERROR_MEMORY;
    }
    l->at = l->sections[UMB_CAPTURE_MOVERS];
    for (uint32_t i = 0; i < movers; ++i) {
        uint32_t object = get_word(l), mark = get_word(l);
        stored[i] = (umb_stored_mover){object, (mark & UMB_CAPTURE_EXACT_MOVER) != 0, (mark & UMB_CAPTURE_FUZZY) != 0};
        marks |= mark;
    }
    l->at = l->sections[UMB_CAPTURE_EXPIRIES];
    for (uint32_t i = 0; i < expiries; ++i) {
        get_doubles(l, &queue[i].until, 1);
        queue[i].mover = get_word(l);
    }
    l->at = l->sections[UMB_CAPTURE_EXACT];
    for (uint32_t i = 0; i < exact; ++i) {
        list[i] = get_word(l);
    }
    if ((marks & ~(uint32_t)UMB_CAPTURE_MOVER_MARKS) != 0) {
        return UMB_ERROR_FORMAT;
    }
    umb_stored_motion motion = {.movers = stored,
                                .expiries = queue,
                                .exact = list,
                                .mover_count = movers,
                                .expiry_count = expiries,
                                .exact_count = exact,
                                .time = l->time,
                                .source = {tell_pose, l->poses}};
    return umb_motion_restore(l->out->scene, &motion);
}

static umb_result read_scene(loader *l, umb_scratch *scratch)
{
    umb_result result = UMB_OK;
    l->at = l->sections[UMB_CAPTURE_OBJECTS];
    for (uint32_t i = 0; i < l->counts[UMB_CAPTURE_OBJECTS] && result == UMB_OK; ++i) {
        result = read_object(l);
    }
    if (result != UMB_OK) {
        return fail_call(l, result, "objects");
    }
    l->at = l->sections[UMB_CAPTURE_OCCLUDERS];
    for (uint32_t i = 0; i < l->counts[UMB_CAPTURE_OCCLUDERS]; ++i) {
        umb_transform transform = get_transform(l);
        umb_shape shape = 0;
        uint32_t id;
        (void)get_shape(l, &shape); /* an occluder without a shape is refused below */
        result = umb_scene_add_occluder(l->out->scene, shape, &transform, &id);
        uint32_t mask = get_word(l);
        result = result == UMB_OK ? umb_scene_mask_occluder(l->out->scene, id, mask) : result;
        if (result != UMB_OK) {
            return fail_call(l, result, "occluders");
        }
    }
    result = read_motion(l, scratch);
    return result == UMB_OK ? UMB_OK : fail_call(l, result, "objects");
}

static umb_result read_index(loader *l, umb_scratch *scratch)
{
    uint32_t count = l->counts[UMB_CAPTURE_NODES];
    uint32_t(*refs)[UMB_NODE_WIDTH] = umb_scratch_get(scratch, count, sizeof *refs);
    if (refs == NULL) {
        return fail_call(l, UMB_ERROR_MEMORY, "index");
    }
    l->at = l->sections[UMB_CAPTURE_NODES];
    for (uint32_t i = 0; i < count * UMB_NODE_WIDTH; ++i) {
        refs[i / UMB_NODE_WIDTH][i % UMB_NODE_WIDTH] = get_word(l);
    }
    float(*boxes)[6][UMB_NODE_WIDTH] = NULL;
    if (l->counts[UMB_CAPTURE_BOXES] > 0) {
        boxes = umb_scratch_get(scratch, count, sizeof *boxes);
        if (boxes == NULL) {
            return fail_call(l, UMB_ERROR_MEMORY, "index");
        }
        l->at = l->sections[UMB_CAPTURE_BOXES];
        for (size_t i = 0; i < 6 * (size_t)count * UMB_NODE_WIDTH; ++i) {
            boxes[i / (6 * UMB_NODE_WIDTH)][i / UMB_NODE_WIDTH % 6][i % UMB_NODE_WIDTH] = get_float(l);
        }
    }
    umb_stored_tree stored = {(const uint32_t(*)[UMB_NODE_WIDTH])refs, (const float(*)[6][UMB_NODE_WIDTH])boxes,
                              count};
    l->out->index_def.tasks = l->tasks;
    umb_result result = umb_index_restore(l->out->scene, &l->out->index_def, &stored, &l->out->index);
    return result == UMB_OK ? UMB_OK : fail_call(l, result, "index's nodes");
}

static umb_result read_candidates(loader *l, umb_scratch *scratch)
{
    uint32_t count = l->counts[UMB_CAPTURE_CANDIDATES];
    uint32_t *bits = umb_scratch_get(scratch, count, sizeof *bits);
    if (bits == NULL) {
        return fail_call(l, UMB_ERROR_MEMORY, "candidates");
    }
    l->at = l->sections[UMB_CAPTURE_CANDIDATES];
    for (uint32_t i = 0; i < count; ++i) {
        bits[i] = get_word(l);
    }
    umb_result result = umb_culler_set_candidates(l->out->culler, bits, l->counts[UMB_CAPTURE_OBJECTS]);
    return result == UMB_OK ? UMB_OK : fail_call(l, result, "candidates");
}

static umb_result load(loader *l, umb_scratch *scratch)
{
    umb_result result = check_header(l);
    result = result == UMB_OK ? check_sections(l) : result;
    result = result == UMB_OK ? read_frame(l) : result;
    if (result != UMB_OK) {
        return result;
    }
    umb_scene_def def = {.origin = {l->origin[0], l->origin[1], l->origin[2]}};
    result = umb_scene_create(&def, &l->out->scene);
    if (result != UMB_OK) {
        return fail_call(l, result, "origin");
    }
    result = read_meshes(l, scratch);
    result = result == UMB_OK ? read_block(l) : result;
    result = result == UMB_OK ? read_scene(l, scratch) : result;
    result = result == UMB_OK ? read_index(l, scratch) : result;
    if (result != UMB_OK) {
        return result;
    }
    umb_culler_def culler_def = {.method = l->out->method, .isa = l->isa};
    result = umb_culler_create(l->out->index, &culler_def, &l->out->culler);
    if (result == UMB_ERROR_ARGUMENT) {
        return umb_error_set(l->error, result, "capture: instruction set %s is not available here",
                             umb_isa_name(l->isa));
    }
    if (result != UMB_OK) {
        return fail_call(l, result, "culler");
    }
    return l->counts[UMB_CAPTURE_CANDIDATES] > 0 ? read_candidates(l, scratch) : UMB_OK;
}

umb_result umb_capture_load(const void *bytes, size_t size, umb_isa isa, umb_tasks tasks,
                            umb_capture *out, umb_error *error)
{
    memset(out, 0, sizeof *out);
    umb_allocator allocator = umb_memory_allocator(NULL);
    umb_scratch scratch = {.allocator = &allocator};
    loader l = {.bytes = bytes, .size = size, .isa = isa, .tasks = tasks, .out = out, .error = error};
    umb_result result = load(&l, &scratch);
    umb_scratch_free(&scratch);
    if (result != UMB_OK) {
        umb_capture_free(out);
    }
    return result;
}

void umb_capture_free(umb_capture *capture)
{
    if (capture != NULL) {
        umb_allocator allocator = umb_memory_allocator(NULL);
        umb_culler_destroy(capture->culler);
        umb_index_destroy(capture->index);
        umb_scene_destroy(capture->scene);
        umb_memory_free(&allocator, capture->block, capture->block_size);
        memset(capture, 0, sizeof *capture);
    }
}
