/* OBJ text with its vertices moved to the origin before anyone narrows them to float. */
#ifndef OBJ_OFFSET_H
#define OBJ_OFFSET_H

#include "input.h"

/* The decimal vertices of a far scene lose digits as floats. When the vertices of text lie far
 * from the origin (model_choose_origin), replace text by one with origin subtracted in double
 * and return true. Else, or when a vertex line is unusual or memory is short, leave text alone,
 * zero origin and return false. */
bool obj_offset(input *text, double origin[3]);

#endif
