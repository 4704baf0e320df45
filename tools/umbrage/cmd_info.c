/* umbrage info: what a scene holds and what is wrong with it. */
#include <stdio.h>

#include "json_text.h"
#include "part_file.h"
#include "setup.h"

/* The faults by name, in the order of model.h. */
static const struct {
    const char *key, *text;
    size_t offset;
} faults[] = {
    {"non_finite", "vertices that are not finite", offsetof(model_faults, non_finite)},
    {"degenerate", "triangles of no area", offsetof(model_faults, degenerate)},
    {"duplicate", "triangles twice in their mesh", offsetof(model_faults, duplicate)},
    {"opposite", "triangles twice, wound the other way", offsetof(model_faults, opposite)},
    {"border_edges", "edges of one triangle only", offsetof(model_faults, border_edges)},
    {"non_manifold_edges", "edges of three triangles or more",
     offsetof(model_faults, non_manifold_edges)},
    {"bad_indices", "triangles that name no vertex", offsetof(model_faults, bad_indices)},
    {"inverted", "closed meshes that face inwards", offsetof(model_faults, inverted)},
    {"outlier_objects", "objects far outside the rest", offsetof(model_faults, outlier_objects)},
    {"empty_objects", "objects without triangles", offsetof(model_faults, empty_objects)},
};
enum { FAULT_COUNT = sizeof faults / sizeof faults[0] };

static uint64_t fault(const model *m, int i)
{
    return *(const uint64_t *)((const char *)&m->faults + faults[i].offset);
}

static uint64_t object_triangles(const model *m, const model_object *object)
{
    return object->mesh == MODEL_NONE ? 0 : m->meshes[object->mesh].triangle_count;
}

static void file_box(const model *m, const umb_aabb *box, double out[2][3])
{
    for (int i = 0; i < 3; ++i) {
        out[0][i] = (double)box->min[i] + m->origin[i];
        out[1][i] = (double)box->max[i] + m->origin[i];
    }
}

/* Objects without triangles have the zero box, not one that the origin moves. */
static void object_box(const model *m, const model_object *object, double out[2][3])
{
    if (object->mesh != MODEL_NONE) {
        file_box(m, &object->bounds, out);
        return;
    }
    for (int i = 0; i < 3; ++i) {
        out[0][i] = out[1][i] = 0.0;
    }
}

static void put_box(json_text *j, const double box[2][3])
{
    json_text_open(j, "bounds", '{');
    json_text_point(j, "min", box[0]);
    json_text_point(j, "max", box[1]);
    json_text_close(j, '}');
}

static uint64_t model_bytes(const model *m)
{
    uint64_t bytes = sizeof *m + (uint64_t)m->object_count * sizeof(model_object);
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        bytes += sizeof(model_mesh) + (uint64_t)m->meshes[i].position_count * 12 +
                 (uint64_t)m->meshes[i].triangle_count * 13;
    }
    return bytes;
}

static void put_weld(json_text *j, const umb_weld_stats *w)
{
    json_text_open(j, "weld", '{');
    json_text_count(j, "objects", w->objects);
    json_text_count(j, "groups", w->groups);
    json_text_count(j, "occluders", w->occluders);
    json_text_count(j, "triangles_in", w->triangles_in);
    json_text_count(j, "triangles_out", w->triangles_out);
    json_text_count(j, "duplicates", w->duplicates);
    json_text_count(j, "sealed", w->sealed);
    json_text_count(j, "t_junctions", w->t_junctions);
    json_text_count(j, "merged", w->merged);
    json_text_close(j, '}');
}

static void put_list(json_text *j, const model *m)
{
    double box[2][3];
    json_text_open(j, "list", '[');
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *object = &m->objects[i];
        json_text_open(j, NULL, '{');
        json_text_count(j, "id", i);
        json_text_string(j, "name", object->name);
        json_text_count(j, "triangles", object_triangles(m, object));
        object_box(m, object, box);
        put_box(j, (const double(*)[3])box);
        json_text_close(j, '}');
    }
    json_text_close(j, ']');
}

static int print_json(const setup *s, const options *o)
{
    const model *m = s->model;
    umb_index_stats index;
    double box[2][3];
    json_text j = {0};
    umb_index_get_stats(s->index, &index);
    file_box(m, &m->bounds, box);
    json_text_open(&j, NULL, '{');
    json_text_string(&j, "scene", o->input);
    json_text_count(&j, "objects", m->object_count);
    json_text_count(&j, "triangles", m->triangles);
    put_box(&j, (const double(*)[3])box);
    json_text_count(&j, "shapes", m->mesh_count);
    json_text_point(&j, "up", m->up);
    json_text_point(&j, "origin", m->origin);
    json_text_count(&j, "occluders", umb_scene_occluder_count(s->scene));
    json_text_open(&j, "memory", '{');
    json_text_count(&j, "model", model_bytes(m));
    json_text_count(&j, "scene", umb_scene_memory(s->scene));
    json_text_count(&j, "index", index.bytes);
    json_text_close(&j, '}');
    json_text_open(&j, "faults", '{');
    for (int i = 0; i < FAULT_COUNT; ++i) {
        json_text_count(&j, faults[i].key, fault(m, i));
    }
    json_text_close(&j, '}');
    put_weld(&j, &s->weld);
    json_text_number(&j, "load_ms", s->load_ms);
    json_text_number(&j, "build_ms", s->build_ms);
    if (options_given(o, "list")) {
        put_list(&j, m);
    }
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static void print_list(const model *m)
{
    double box[2][3];
    printf("\n%8s %10s  %-44s %s\n", "id", "triangles", "bounds", "name");
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *object = &m->objects[i];
        char bounds[128];
        object_box(m, object, box);
        snprintf(bounds, sizeof bounds, "%.7g,%.7g,%.7g..%.7g,%.7g,%.7g", box[0][0], box[0][1],
                 box[0][2], box[1][0], box[1][1], box[1][2]);
        printf("%8u %10llu  %-44s %s\n", i, (unsigned long long)object_triangles(m, object), bounds,
               object->name);
    }
}

static int print_text(const setup *s, const options *o)
{
    const model *m = s->model;
    umb_index_stats index;
    double box[2][3];
    umb_index_get_stats(s->index, &index);
    file_box(m, &m->bounds, box);
    printf("%-12s %s\n", "scene", o->input);
    printf("%-12s %u\n", "objects", m->object_count);
    printf("%-12s %llu\n", "triangles", (unsigned long long)m->triangles);
    printf("%-12s %u\n", "shapes", m->mesh_count);
    printf("%-12s %.9g,%.9g,%.9g to %.9g,%.9g,%.9g\n", "bounds", box[0][0], box[0][1], box[0][2],
           box[1][0], box[1][1], box[1][2]);
    printf("%-12s %g,%g,%g\n", "up", m->up[0], m->up[1], m->up[2]);
    printf("%-12s %.9g,%.9g,%.9g\n", "origin", m->origin[0], m->origin[1], m->origin[2]);
    printf("%-12s %u: %u welded from %u groups of touching objects\n", "occluders",
           umb_scene_occluder_count(s->scene), s->weld.occluders, s->weld.groups);
    printf("%-12s %.2f MiB scene, %.2f MiB index of %u nodes\n", "memory",
           (double)umb_scene_memory(s->scene) / 1048576.0, (double)index.bytes / 1048576.0,
           index.nodes);
    uint64_t all = 0;
    for (int i = 0; i < FAULT_COUNT; ++i) {
        uint64_t n = fault(m, i);
        if (n > 0) {
            printf("%-12s %llu %s\n", all == 0 ? "faults" : "", (unsigned long long)n,
                   faults[i].text);
        }
        all += n;
    }
    if (all == 0) {
        printf("%-12s none\n", "faults");
    }
    if (options_given(o, "list")) {
        print_list(m);
    }
    return EXIT_DONE;
}

int cmd_info(const options *o)
{
    setup s;
    int code = setup_scene(&s, o);
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&s, o) : print_text(&s, o);
    }
    setup_free(&s);
    return code;
}
