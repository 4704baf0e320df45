/* The files that the importer opens: the scene from memory, what lies beside it from the disk. */
#ifndef IMPORT_FILES_H
#define IMPORT_FILES_H

#include <assimp/cfileio.h>

#include "input.h"

typedef struct import_files {
    struct aiFileIO io;
    const char *path;
    input scene;
} import_files;

/* Read the scene: a file that is missing or empty is told in our own words. OBJ text is held
 * with far vertices moved to the origin; origin says by how much, zeros in all other cases. The
 * struct must stay where it is until it is closed. */
bool import_files_open(import_files *files, const char *path, double origin[3], umb_error *error);
void import_files_close(import_files *files);

#endif
