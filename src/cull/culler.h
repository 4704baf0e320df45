/* What capture and tests read of a culler. */
#ifndef UMB_CULLER_H
#define UMB_CULLER_H

#include "occlusion/coverage.h"
#include "scene/motion.h"
#include "umbrage/cull.h"

const umb_index *umb_culler_index(const umb_culler *culler);
umb_culler_def umb_culler_settings(const umb_culler *culler);
/* The view and answer of the last umb_cull; NULL before the first, and when the scene has changed
 * since: what the answer was given for is then gone. */
const umb_view *umb_culler_last_view(const umb_culler *culler, const uint32_t **ids, uint32_t *count);
/* The method's buffer as the last umb_cull left it, or NULL. */
const umb_coverage *umb_culler_coverage(const umb_culler *culler);
/* The candidates, as umb_culler_set_candidates() was given them, or NULL. */
const uint32_t *umb_culler_candidates(const umb_culler *culler, uint32_t *object_count);
/* What the culler was told of moving objects for the last answer, and perhaps for others of the same time. */
const umb_posed *umb_culler_posed(const umb_culler *culler, uint32_t *count);
/* The method's own state, for measurements; NULL: it has none. */
void *umb_culler_method_state(const umb_culler *culler);

#endif
