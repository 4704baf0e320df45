/* Umbrage: conservative visibility culling. This header includes all the others; each stands alone.
 * Start with scene.h, then cull.h. */
#ifndef UMBRAGE_H
#define UMBRAGE_H

#include "base.h"
#include "bounds.h"
#include "capture.h"
#include "cull.h"
#include "geometry.h"
#include "index.h"
#include "light.h"
#include "motion.h"
#include "region.h"
#include "scene.h"
#include "view.h"

#endif
