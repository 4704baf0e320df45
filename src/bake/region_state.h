/* What the files of the region engine share. */
#ifndef UMB_REGION_STATE_H
#define UMB_REGION_STATE_H

#include "beam.h"
#include "index/tree.h"
#include "pieces.h"
#include "ray_map.h"
#include "solid_tree.h"
#include "umbrage/region.h"

#define UMB_REGION_MAPS 8
#define UMB_REGION_FRAMES 6

struct umb_region {
    umb_index *index;
    umb_allocator allocator;
    umb_tasks tasks;
    umb_error *error;
    const umb_umbra_kernels *kernels;

    umb_region_query query; /* of the last solve, defaults filled in */
    double corners[8][3];   /* of its cell */
    double reach;           /* no coordinate of scene or cell is larger */
    bool solved;

    umb_ray_frame frames[UMB_REGION_FRAMES]; /* two for each of the axes that rays are sorted by */
    uint32_t frame_count;
    umb_ray_map maps[UMB_REGION_MAPS]; /* of frame k: k, and k + 4 with squares */
    uint32_t map_count;
    double floor; /* the lowest point of scene and cell */
    umb_pieces pieces;
    uint64_t *queue; /* what is waiting: a heap of orders */
    size_t queue_capacity, queue_count;
    uint8_t *known; /* per occluder of this version of the scene */
    size_t known_capacity;
    uint64_t version;
    uint32_t objects; /* live ones of this version, and their triangles */
    uint64_t triangles;
    double surface; /* of their bounds */
    uint32_t *used; /* occluders that the walk found not hidden */
    size_t used_capacity, used_count;
    umb_solids found;  /* bodies of occluders that cells of this version used */
    uint64_t found_version;
    umb_solids solids; /* those of this cell; the planes are found's */
    umb_solid_tree solid_tree;

    uint32_t *pvs, *refined;
    uint8_t *verdicts; /* per object of pvs */
    size_t pvs_capacity, refined_capacity, verdict_capacity;
    umb_region *part; /* for parts of cells, once one is cut */
    umb_region_answer answer;
};

/* Find the set of the cell by occlusion maps. */
umb_result umb_region_walk(umb_region *region);

/* About an object of the set: nothing yet; a segment to it that no body meets; hidden; too many parts to decide. */
enum { UMB_LEFT = 0, UMB_STAYS = 1, UMB_HIDDEN = 2, UMB_UNDECIDED = 3 };

/* Hold what the walk left, sorted, against single bodies; takes what they hide from the set. Fills in verdicts. */
umb_result umb_region_look(umb_region *region);

/* Bodies of the occluders that the walk used, and their tree. */
umb_result umb_region_find_bodies(umb_region *region);

/* What stands for an object: the shape's box where it stands, or its bounds. */
umb_beam_part umb_region_target(const umb_object *object, double reach);

/* How wide an object is in the mean: the cube of as much surface. 0 if there is nothing. */
double umb_region_width(const umb_region *region);

/* How many pixels maps have for this cell: along s and along t. */
void umb_region_grain(const umb_region *region, uint32_t *rows, uint32_t *columns);

/* Decide about the objects of the set one by one whose verdict is open. */
void umb_region_decide(umb_region *region, uint32_t effort);

/* The same for a cell that is large for what stands around it: by the maps of its parts first. Fails if memory does. */
umb_result umb_region_decide_parts(umb_region *region, uint32_t effort);

/* Fill in region->error and return code. */
umb_result umb_region_fail(const umb_region *region, umb_result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
