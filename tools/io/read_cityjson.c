/* CityJSON: cities as surfaces with holes, on a shared table of integer vertices.
 *
 * Objects are the city objects that have surfaces, in the file's order: in most files one a
 * building part. Of several levels of detail the highest is taken. Vertices become floats once,
 * after the scale, the translation and our own offset have been applied in double. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model_parts.h"
#include "polygon.h"
#include "readers.h"

typedef struct city {
    const char *name;   /* of the file, for error texts */
    const char *object; /* the city object at hand */
    umb_error *error;
    model *into;
    double (*vertices)[3]; /* in the file's coordinates, minus the origin */
    double (*corners)[3];  /* as they stand in the file: integers, so that turns are exact */
    uint32_t vertex_count;
    double origin[3];
    uint32_t *mark, *local; /* which object last used a vertex, and its number there */
    bool *glass;            /* per material: one sees through it */
    size_t glass_count;
    /* The object's mesh, and the surface's corners. */
    model_mesh mesh;
    uint32_t position_room, triangle_room;
    double (*ring_corners)[3];
    uint32_t *ring_vertices, *ring_starts, (*cut)[3];
    size_t corner_room, ring_room;
} city;

static bool short_of_memory(city *c)
{
    return model_fail_memory(c->error, c->name);
}

/* A wrong value, told with the object that holds it. */
static bool wrong(city *c, const char *what)
{
    return model_fail(c->error, UMB_ERROR_FORMAT,
                      "%s: object %.80s: %s; validate the file with cjio", c->name, c->object, what);
}

static bool read_triple(const json_t *array, double out[3])
{
    if (json_array_size(array) != 3) {
        return false;
    }
    for (size_t k = 0; k < 3; ++k) {
        const json_t *number = json_array_get(array, k);
        if (!json_is_number(number)) {
            return false;
        }
        out[k] = json_number_value(number);
    }
    return true;
}

/* The table of vertices, and where the scene's origin goes. */
static bool read_vertices(city *c, const json_t *root)
{
    double scale[3] = {1.0, 1.0, 1.0};
    double translate[3] = {0.0, 0.0, 0.0};
    const json_t *transform = json_object_get(root, "transform");
    if (transform != NULL && (!read_triple(json_object_get(transform, "scale"), scale) ||
                              !read_triple(json_object_get(transform, "translate"), translate))) {
        return model_fail(c->error, UMB_ERROR_FORMAT,
                          "%s: transform: scale and translate must be three numbers each", c->name);
    }
    const json_t *table = json_object_get(root, "vertices");
    size_t count = json_array_size(table);
    if (!json_is_array(table) || count > UINT32_MAX / 2) {
        return model_fail(c->error, UMB_ERROR_FORMAT,
                          "%s: vertices: no list of vertices; is this CityJSON?", c->name);
    }
    c->vertex_count = (uint32_t)count;
    c->vertices = malloc((count + 1) * sizeof *c->vertices);
    c->corners = malloc((count + 1) * sizeof *c->corners);
    c->mark = calloc(count + 1, sizeof *c->mark);
    c->local = calloc(count + 1, sizeof *c->local);
    if (c->vertices == NULL || c->corners == NULL || c->mark == NULL || c->local == NULL) {
        return short_of_memory(c);
    }
    double min[3] = {0};
    double max[3] = {0};
    for (size_t v = 0; v < count; ++v) {
        if (!read_triple(json_array_get(table, v), c->corners[v])) {
            return model_fail(
                c->error, UMB_ERROR_FORMAT,
                "%s: vertices: number %zu is no list of three numbers; validate the file with cjio",
                c->name, v);
        }
        for (int k = 0; k < 3; ++k) {
            double x = c->corners[v][k] * scale[k] + translate[k];
            c->vertices[v][k] = x;
            min[k] = v == 0 ? x : fmin(min[k], x);
            max[k] = v == 0 ? x : fmax(max[k], x);
        }
    }
    model_choose_origin(min, max, c->origin);
    for (size_t v = 0; v < 3 * count; ++v) {
        c->vertices[v / 3][v % 3] -= c->origin[v % 3];
    }
    return true;
}

static bool read_materials(city *c, const json_t *root)
{
    const json_t *list = json_object_get(json_object_get(root, "appearance"), "materials");
    size_t count = json_array_size(list);
    c->glass = calloc(count + 1, sizeof *c->glass);
    if (c->glass == NULL) {
        return short_of_memory(c);
    }
    c->glass_count = count;
    for (size_t i = 0; i < count; ++i) {
        c->glass[i] = json_number_value(json_object_get(json_array_get(list, i), "transparency")) >
                      0.0;
    }
    return true;
}

/* One surface's material, by a theme's value there. */
static bool is_glass(const city *c, const json_t *material)
{
    return json_is_integer(material) && json_integer_value(material) >= 0 &&
           (uint64_t)json_integer_value(material) < c->glass_count &&
           c->glass[json_integer_value(material)];
}

/* Lists that run beside a geometry's boundaries, followed level by level. A list that ends
 * early, or says null for a whole level, says nothing. */
#define THEME_LIMIT 8

typedef struct beside {
    const json_t *semantics; /* numbers into types */
    const json_t *types;
    const json_t *materials[THEME_LIMIT];
    bool glass; /* one material for the whole geometry, and one sees through it */
} beside;

static beside beside_at(const beside *b, size_t i)
{
    beside at = *b;
    at.semantics = json_array_get(b->semantics, i);
    for (int k = 0; k < THEME_LIMIT; ++k) {
        at.materials[k] = json_array_get(b->materials[k], i);
    }
    return at;
}

static beside beside_start(const city *c, const json_t *geometry)
{
    const json_t *semantics = json_object_get(geometry, "semantics");
    beside b = {.semantics = json_object_get(semantics, "values"),
                .types = json_object_get(semantics, "surfaces")};
    const char *theme;
    json_t *entry;
    int themes = 0;
    json_object_foreach(json_object_get(geometry, "material"), theme, entry)
    {
        b.glass = b.glass || is_glass(c, json_object_get(entry, "value"));
        if (themes < THEME_LIMIT) {
            b.materials[themes++] = json_object_get(entry, "values");
        }
    }
    return b;
}

static uint8_t surface_flags(const city *c, const beside *b)
{
    bool open = b->glass;
    for (int k = 0; k < THEME_LIMIT; ++k) {
        open = open || is_glass(c, b->materials[k]);
    }
    if (json_is_integer(b->semantics) && json_integer_value(b->semantics) >= 0) {
        const json_t *type = json_object_get(
            json_array_get(b->types, (size_t)json_integer_value(b->semantics)), "type");
        open = open || (json_is_string(type) && strcmp(json_string_value(type), "Window") == 0);
    }
    return open ? UMB_TRIANGLE_OPEN : 0;
}

/* Room for a surface of so many corners and rings. */
static bool reserve_surface(city *c, size_t corners, size_t rings)
{
    if (corners > c->corner_room || rings > c->ring_room) {
        c->corner_room = corners > 2 * c->corner_room ? corners : 2 * c->corner_room;
        c->ring_room = rings > 2 * c->ring_room ? rings : 2 * c->ring_room;
        free(c->ring_corners);
        free(c->ring_vertices);
        free(c->ring_starts);
        free(c->cut);
        c->ring_corners = malloc((c->corner_room + 1) * sizeof *c->ring_corners);
        c->ring_vertices = malloc((c->corner_room + 1) * sizeof *c->ring_vertices);
        c->ring_starts = malloc((c->ring_room + 1) * sizeof *c->ring_starts);
        c->cut = malloc((c->corner_room + 2 * c->ring_room + 1) * sizeof *c->cut);
    }
    return (c->ring_corners != NULL && c->ring_vertices != NULL && c->ring_starts != NULL &&
            c->cut != NULL) ||
           short_of_memory(c);
}

static bool reserve_mesh(city *c, size_t triangles)
{
    size_t need = c->mesh.triangle_count + triangles;
    if (need <= c->triangle_room) {
        return true;
    }
    if (need > 1u << 28) {
        return wrong(c, "too many triangles");
    }
    size_t room = need > 2 * (size_t)c->triangle_room ? need : 2 * (size_t)c->triangle_room;
    float *positions = realloc(c->mesh.positions, 9 * room * sizeof *positions);
    c->mesh.positions = positions != NULL ? positions : c->mesh.positions;
    uint32_t *indices = realloc(c->mesh.indices, 3 * room * sizeof *indices);
    c->mesh.indices = indices != NULL ? indices : c->mesh.indices;
    uint8_t *flags = realloc(c->mesh.flags, room);
    c->mesh.flags = flags != NULL ? flags : c->mesh.flags;
    if (positions == NULL || indices == NULL || flags == NULL) {
        return short_of_memory(c);
    }
    c->triangle_room = (uint32_t)room;
    return true;
}

static uint32_t local_vertex(city *c, uint32_t vertex)
{
    uint32_t object = c->into->object_count + 1;
    if (c->mark[vertex] != object) {
        c->mark[vertex] = object;
        c->local[vertex] = c->mesh.position_count++;
        for (int k = 0; k < 3; ++k) {
            c->mesh.positions[3 * (size_t)c->local[vertex] + k] = (float)c->vertices[vertex][k];
        }
    }
    return c->local[vertex];
}

/* Cutting ears takes the square of this many steps. */
#define CORNER_LIMIT 32768

/* Copy the rings of a surface; a corner that repeats the one before it is none. */
static bool read_rings(city *c, const json_t *surface, uint32_t *rings)
{
    size_t corners = 0;
    for (size_t r = 0; r < json_array_size(surface); ++r) {
        corners += json_array_size(json_array_get(surface, r));
    }
    if (corners > CORNER_LIMIT) {
        return wrong(c, "a surface has more than 32768 corners");
    }
    if (!reserve_surface(c, corners, json_array_size(surface))) {
        return false;
    }
    uint32_t used = 0;
    *rings = 0;
    for (size_t r = 0; r < json_array_size(surface); ++r) {
        const json_t *ring = json_array_get(surface, r);
        uint32_t first = used;
        c->ring_starts[(*rings)++] = first;
        for (size_t i = 0; i < json_array_size(ring); ++i) {
            const json_t *number = json_array_get(ring, i);
            json_int_t vertex = json_integer_value(number);
            if (!json_is_integer(number) || vertex < 0 || vertex >= (json_int_t)c->vertex_count) {
                return wrong(c, "a surface names a vertex that is not there");
            }
            if (used == first || c->ring_vertices[used - 1] != (uint32_t)vertex) {
                c->ring_vertices[used] = (uint32_t)vertex;
                memcpy(c->ring_corners[used++], c->corners[vertex], sizeof c->corners[vertex]);
            }
        }
        if (used > first + 1 && c->ring_vertices[used - 1] == c->ring_vertices[first]) {
            --used;
        }
    }
    c->ring_starts[*rings] = used;
    return true;
}

static bool read_surface(city *c, const json_t *surface, const beside *b)
{
    uint32_t rings = 0;
    if (!json_is_array(surface)) {
        return wrong(c, "a surface is no list of rings");
    }
    if (!read_rings(c, surface, &rings)) {
        return false;
    }
    polygon p = {
        .corners = (const double(*)[3])c->ring_corners, .starts = c->ring_starts, .rings = rings};
    bool sound;
    uint32_t count = polygon_triangulate(&p, c->cut, &sound);
    if (count == UINT32_MAX) {
        return short_of_memory(c);
    }
    if (!reserve_mesh(c, count)) {
        return false;
    }
    /* What an unsound surface covers is unknown: it can be seen and hides nothing. */
    uint8_t flags = surface_flags(c, b) | (sound ? 0 : UMB_TRIANGLE_OPEN);
    for (uint32_t t = 0; t < count; ++t) {
        for (int k = 0; k < 3; ++k) {
            c->mesh.indices[3 * (size_t)c->mesh.triangle_count + k] = local_vertex(
                c, c->ring_vertices[c->cut[t][k]]);
        }
        c->mesh.flags[c->mesh.triangle_count++] = flags;
    }
    return true;
}

/* Surfaces lie depth lists deep: 1 in a MultiSurface, 2 in a Solid, 3 in a MultiSolid. */
static bool read_boundaries(city *c, const json_t *list, const beside *b, int depth)
{
    if (!json_is_array(list)) {
        return wrong(c, "boundaries are no list");
    }
    for (size_t i = 0; i < json_array_size(list); ++i) {
        beside at = beside_at(b, i);
        const json_t *item = json_array_get(list, i);
        if (depth == 1 ? !read_surface(c, item, &at) : !read_boundaries(c, item, &at, depth - 1)) {
            return false;
        }
    }
    return true;
}

/* How deep the surfaces of a geometry lie; 0 for points, lines and templates, which have none. */
static int surface_depth(const json_t *geometry)
{
    static const struct {
        const char *type;
        int depth;
    } types[] = {
        {"MultiSurface", 1}, {"CompositeSurface", 1}, {"Solid", 2},
        {"MultiSolid", 3},   {"CompositeSolid", 3},
    };
    const char *type = json_string_value(json_object_get(geometry, "type"));
    for (size_t i = 0; type != NULL && i < sizeof types / sizeof types[0]; ++i) {
        if (strcmp(type, types[i].type) == 0) {
            return types[i].depth;
        }
    }
    return 0;
}

/* A level of detail, "2.2" or 2.2; -1 where none is given. */
static double level(const json_t *geometry)
{
    const json_t *lod = json_object_get(geometry, "lod");
    if (json_is_string(lod)) {
        return strtod(json_string_value(lod), NULL);
    }
    return json_is_number(lod) ? json_number_value(lod) : -1.0;
}

static bool read_object(city *c, const char *name, const json_t *geometries)
{
    double highest = -1.0;
    for (size_t i = 0; i < json_array_size(geometries); ++i) {
        const json_t *geometry = json_array_get(geometries, i);
        highest = surface_depth(geometry) != 0 ? fmax(highest, level(geometry)) : highest;
    }
    c->object = name;
    c->mesh.position_count = 0;
    c->mesh.triangle_count = 0;
    for (size_t i = 0; i < json_array_size(geometries); ++i) {
        const json_t *geometry = json_array_get(geometries, i);
        int depth = surface_depth(geometry);
        if (depth == 0 || level(geometry) < highest) {
            continue;
        }
        beside b = beside_start(c, geometry);
        if (!read_boundaries(c, json_object_get(geometry, "boundaries"), &b, depth)) {
            return false;
        }
    }
    uint32_t mesh = MODEL_NONE;
    if (c->mesh.triangle_count != 0) {
        mesh = model_add_mesh(c->into, &c->mesh);
        if (mesh == MODEL_NONE) {
            return short_of_memory(c);
        }
    }
    return model_add_object(c->into, name, mesh, NULL) != MODEL_NONE || short_of_memory(c);
}

static bool read_objects(city *c, json_t *root)
{
    json_t *objects = json_object_get(root, "CityObjects");
    if (!json_is_object(objects)) {
        return model_fail(c->error, UMB_ERROR_FORMAT, "%s: no CityObjects in it; is this CityJSON?",
                          c->name);
    }
    const char *name;
    json_t *object;
    json_object_foreach(objects, name, object)
    {
        const json_t *geometries = json_object_get(object, "geometry");
        if (json_array_size(geometries) != 0 && !read_object(c, name, geometries)) {
            return false;
        }
    }
    return true;
}

static void city_end(city *c)
{
    free(c->vertices);
    free(c->corners);
    free(c->mark);
    free(c->local);
    free(c->glass);
    free(c->mesh.positions);
    free(c->mesh.indices);
    free(c->mesh.flags);
    free(c->ring_corners);
    free(c->ring_vertices);
    free(c->ring_starts);
    free(c->cut);
}

static bool read_city(city *c, json_t *root, const model_options *options)
{
    const json_t *type = json_object_get(root, "type");
    if (!json_is_string(type) || strcmp(json_string_value(type), "CityJSON") != 0) {
        return model_fail(c->error, UMB_ERROR_FORMAT,
                          "%s: JSON whose type is not CityJSON; use a CityJSON file", c->name);
    }
    c->into = model_create();
    if (c->into == NULL) {
        return short_of_memory(c);
    }
    c->into->up[1] = 0.0;
    c->into->up[2] = 1.0;
    if (!read_vertices(c, root) || !read_materials(c, root) || !read_objects(c, root)) {
        return false;
    }
    memcpy(c->into->origin, c->origin, sizeof c->origin);
    return model_finish(c->into, options, c->error);
}

model *read_cityjson(const uint8_t *data, size_t size, const char *name,
                     const model_options *options, umb_error *error)
{
    json_error_t where;
    json_t *root = json_loadb((const char *)data, size, 0, &where);
    if (root == NULL) {
        model_fail(error, UMB_ERROR_FORMAT,
                   "%s:%d:%d: not JSON: %.100s; validate the file with cjio", name, where.line,
                   where.column, where.text);
        return NULL;
    }
    city c = {.name = name, .object = "", .error = error};
    bool read = read_city(&c, root, options);
    json_decref(root);
    city_end(&c);
    if (!read) {
        model_free(c.into);
        return NULL;
    }
    return c.into;
}
