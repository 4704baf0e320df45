/* The numbers of the committed occluders: dense, owned ones first. What goes leaves a hole; the last of its kind
 * fills it, so that a change costs the same in a scene of any size.
 *
 *     owned                  stand-alone
 *     0 1 2 ... first - 1    first ... count - 1
 */
#include "scene_state.h"

static void list(umb_scene *scene, uint32_t number)
{
    umb_committed *c = &scene->committed;
    if (!scene->sources[number].replaced) {
        scene->sources[number].replaced = true;
        scene->committed_replaced[c->replaced_count++] = number;
    }
}

/* Where the number of an occluder is known by. */
static uint32_t *home_of(umb_scene *scene, const umb_occluder *occluder, const umb_occluder_source *source)
{
    if (occluder->owner != UMB_NONE) {
        return &scene->committed_objects[occluder->owner].occluder;
    }
    return source->group != NULL ? &source->group->numbers[source->index] : &scene->occluders[source->index].number;
}

static uint32_t mask_of(const umb_scene *scene, const umb_occluder *occluder, const umb_occluder_source *source)
{
    if (occluder->owner != UMB_NONE) {
        return scene->objects[occluder->owner].mask;
    }
    return source->group != NULL ? source->group->mask : scene->occluders[source->index].mask;
}

static void put(umb_scene *scene, uint32_t number, const umb_occluder *occluder, umb_weld_group *group, uint32_t index)
{
    umb_occluder_source *source = &scene->sources[number];
    scene->committed_occluders[number] = *occluder;
    source->group = group;
    source->index = index;
    scene->committed_masks[number] = mask_of(scene, occluder, source);
    scene->committed.masked = scene->committed.masked || scene->committed_masks[number] != 0;
    *home_of(scene, occluder, source) = number;
    list(scene, number);
}

static void renumber(umb_scene *scene, uint32_t from, uint32_t to)
{
    if (from != to) {
        umb_occluder occluder = scene->committed_occluders[from];
        put(scene, to, &occluder, scene->sources[from].group, scene->sources[from].index);
    }
}

void umb_occluders_add_owned(umb_scene *scene, const umb_occluder *occluder)
{
    umb_committed *c = &scene->committed;
    uint32_t number = c->first_free_occluder;
    renumber(scene, number, c->occluder_count);
    put(scene, number, occluder, NULL, 0);
    c->first_free_occluder += 1;
    c->occluder_count += 1;
}

void umb_occluders_add_free(umb_scene *scene, const umb_occluder *occluder, umb_weld_group *group, uint32_t index)
{
    umb_committed *c = &scene->committed;
    put(scene, c->occluder_count, occluder, group, index);
    c->occluder_count += 1;
}

void umb_occluders_change(umb_scene *scene, uint32_t number, const umb_occluder *occluder)
{
    bool other = scene->committed_occluders[number].mesh != occluder->mesh;
    scene->committed_occluders[number] = *occluder;
    scene->committed_masks[number] = scene->objects[occluder->owner].mask;
    if (other) {
        list(scene, number);
    }
}

void umb_occluders_remove(umb_scene *scene, uint32_t number)
{
    umb_committed *c = &scene->committed;
    uint32_t hole = number;
    *home_of(scene, &scene->committed_occluders[number], &scene->sources[number]) = UMB_NONE;
    if (number < c->first_free_occluder) {
        hole = --c->first_free_occluder;
        renumber(scene, hole, number);
    }
    c->occluder_count -= 1;
    renumber(scene, c->occluder_count, hole);
    list(scene, c->occluder_count);
    list(scene, number);
}
