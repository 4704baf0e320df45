/* Files that pictures and scenes are written to. */
#ifndef OUTPUT_H
#define OUTPUT_H

#include <stdio.h>

#include "umbrage/base.h"

/* Open path for writing, emptied. NULL with error filled in. */
FILE *output_open(const char *path, umb_error *error);
/* Close; true if good is and every byte was written, else the file is removed. error keeps what
 * it holds when good is false. Callers whose readers must never see a half-written file name one
 * beside the real place, and rename it. */
bool output_close(FILE *f, const char *path, bool good, umb_error *error);

#endif
