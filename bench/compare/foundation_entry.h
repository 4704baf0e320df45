/* The foundation as a contestant. */
#ifndef FOUNDATION_ENTRY_H
#define FOUNDATION_ENTRY_H

#include "entries.h"
#include "foundation.h"

/* Load what scripts/foundation built; it stays loaded. NULL with error filled in. */
const foundation_interface *foundation_open(const char *file, umb_error *error);

/* w->foundation over w. False, after a line on standard error, where it does not read w as today's library does. */
bool foundation_entry(const world *w, entry *out);

#endif
