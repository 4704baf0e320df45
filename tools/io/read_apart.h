/* Reading in a process of its own.
 *
 * The importer is a large library that hostile files can crash. It runs in a child, which hands the
 * model back through a pipe; when the child dies, that is one more file that cannot be read.
 */
#ifndef READ_APART_H
#define READ_APART_H

#include "model.h"

/* Makes a model that is not finished yet, or returns NULL with error filled in. */
typedef model *read_function(const char *path, umb_error *error);

/* What read would return, read by a child. */
model *read_apart(read_function *read, const char *path, umb_error *error);

#endif
