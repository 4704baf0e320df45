/* What is known of a scene's occluders before a frame chooses among them: the facets of each mesh that is one, and bounds
 * of the area that each occluder, and each node of an index, can show. It follows the scene by its change lists, and the
 * tree by what was touched in it: a commit costs what it changes, if it was the only one since the last frame. */
#ifndef UMB_OCCLUDER_SETS_H
#define UMB_OCCLUDER_SETS_H

#include "facets.h"
#include "index/tree.h"
#include "method.h"

/* The facets of a mesh, shared by all occluders that are this mesh. */
typedef struct umb_mesh_facets {
    umb_facets facets;
    const umb_mesh *mesh; /* NULL: nobody's */
    uint32_t users;
} umb_mesh_facets;

typedef struct umb_occluder_sets {
    umb_allocator allocator;
    umb_mesh_facets *sets; /* UMB_SET_WELDED, and one for each mesh */
    uint32_t set_count;
    uint32_t *table;       /* of sets, by mesh: open; UMB_NONE is empty */
    uint32_t table_size, table_used;
    uint32_t *free_sets;   /* numbers of sets that are nobody's */
    uint32_t free_count;
    uint32_t *set_of;      /* per occluder; UMB_NONE: there is none of this number */
    uint32_t known_count;  /* of set_of */
    umb_facet_source soup; /* of the welded surfaces; owned */
    uint32_t *soup_tags;
    uint8_t *soup_sides;
    uint32_t soup_positions, soup_users;
    uint64_t welds;        /* how often the welded set was made: its facets have other numbers since */
    uint32_t *soup_first;  /* per occluder: its first facet in the welded set; the end is the next one's */
    float *areas;          /* per occluder: at least the area that it can show */
    float *node_areas;     /* per node and block: at least the largest below it */
    const umb_tree *tree;  /* that these are of */
    size_t set_capacity, table_capacity, free_capacity, of_capacity, first_capacity, area_capacity, node_capacity;
    size_t soup_position_capacity, soup_triangle_capacity, soup_tag_capacity, soup_side_capacity;
    uint64_t structure, version;
    bool known;            /* the above is of this structure and version */
} umb_occluder_sets;

#define UMB_SET_WELDED 0u

/* Bodies of more facets are not asked about as a whole. */
enum { UMB_BODY_FACETS = 16 };

void umb_occluder_sets_create(umb_occluder_sets *s, const umb_allocator *a);
void umb_occluder_sets_free(umb_occluder_sets *s);

/* Bring it up to date. False without memory: it then knows nothing. */
bool umb_occluder_sets_follow(umb_occluder_sets *s, const umb_choice *choice);

/* A welded surface: its facets are a part of UMB_SET_WELDED. A body that stands alone is none, whoever made it. */
static inline bool umb_occluder_is_welded(const umb_occluder *o)
{
    return o->owner == UMB_NONE && o->identity && !o->moves && !o->mesh->convex;
}

/* A body that is asked about as a whole. */
bool umb_occluder_is_body(const umb_occluder_sets *s, const umb_committed *scene, uint32_t occluder);

/* The occluder of an item; UMB_NONE: it has none. */
static inline uint32_t umb_occluder_of(const umb_committed *scene, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    return (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? scene->objects[number].occluder : number;
}

#endif
