/* The picture of a cell's answer: the scene from above, and the occlusion maps. */
#ifndef REGION_PICTURE_H
#define REGION_PICTURE_H

#include "io/bitmap.h"
#include "io/model.h"
#include "umbrage/region.h"

/* Fill the bitmap. states: as picture_cell_map() wants them. The occlusion maps are those of the engine's last
 * solve: white where no ray goes, dark where nothing is hidden, else paler the higher the hidden heights reach. False
 * only when memory is short. */
bool region_picture(bitmap *im, const model *m, const umb_region *region,
                    const umb_region_query *query, const uint8_t *states);

#endif
