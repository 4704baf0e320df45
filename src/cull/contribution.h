/* Contribution culling (Gummerus 2, step five): what is too small in the picture to matter. */
#ifndef UMB_CONTRIBUTION_H
#define UMB_CONTRIBUTION_H

#include "index/tree.h"
#include "umbrage/view.h"

/* True if the picture of a box is less than view->min_pixels wide and high. A box that reaches the eye's
 * plane is not. */
bool umb_contribution_small(const umb_view *view, const umb_aabb *box);
/* The same for a box of a node. */
bool umb_contribution_small_slot(const umb_view *view, const umb_node *node, uint32_t slot);

#endif
