/* What the files of the region engine share. */
#ifndef UMB_REGION_STATE_H
#define UMB_REGION_STATE_H

#include "index/tree.h"
#include "solid.h"
#include "umbrage/region.h"

struct umb_region {
    umb_index *index;
    umb_allocator allocator;
    umb_tasks tasks;
    umb_error *error;
    umb_isa isa;

    umb_region_query query; /* of the last solve, defaults filled in */
    double corners[8][3];   /* of its cell */
    bool solved;
    umb_solids solids;

    uint32_t *pvs, *refined;
    size_t pvs_capacity, refined_capacity;
    umb_region_answer answer;
};

/* Fill in region->error and return code. */
umb_result umb_region_fail(const umb_region *region, umb_result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
