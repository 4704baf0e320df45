/* Bytes of a scene: from a file, or from a file inside a .pk3 or .zip. */
#ifndef INPUT_H
#define INPUT_H

#include "umbrage/base.h"

typedef struct input {
    uint8_t *data; /* size bytes and a zero behind them, so that text can be read as a string */
    size_t size;
} input;

/* Read all of a file. Directories, unreadable and empty files are errors with text. */
bool input_read(const char *path, input *out, umb_error *error);
/* Read one member of an archive. member NULL: the only maps/NAME.bsp there is. */
bool input_read_packed(const char *archive, const char *member, input *out, umb_error *error);
void input_free(input *in);

/* "FILE.pk3:maps/x.bsp": where the colon is, or NULL when name is no such thing. */
const char *input_packed_name(const char *name);

/* True if name ends with ending, letters of either case. */
bool input_ends_with(const char *name, const char *ending);

#endif
