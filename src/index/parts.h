/* Trees that hold items in parts, and motion. */
#ifndef UMB_PARTS_H
#define UMB_PARTS_H

#include "bvh.h"

/* Before umb_bvh_refit_moved(): objects that moved keep one place, which gets the whole box then, and lose the others,
 * whose nodes are marked. Only where a place is the last of its node it stays, with the whole box, too. places and next
 * as in umb_bvh_find_places(); lists of objects below nodes are left as they are. */
void umb_parts_gather_moved(umb_node *nodes, uint32_t *places, uint32_t *next, const umb_bvh_marks *marks,
                            const umb_committed *scene);

#endif
