/* Nothing half-written, whatever happens: files are written beside their place and renamed when
 * whole, and an interrupt removes what is not. */
#ifndef PART_FILE_H
#define PART_FILE_H

#include "io/bitmap.h"
#include "json_text.h"
#include "options.h"

/* From here on an interrupt (SIGINT, SIGTERM) removes the unfinished file and leaves with
 * EXIT_INTERRUPTED. */
void part_file_watch(void);

/* Start the file that is to become path: returns the name to write to, NULL when memory is short.
 * One at a time. */
const char *part_file_begin(const char *path);
/* End it. keep: give it its own name; returns false (and removes it) when that fails. */
bool part_file_end(bool keep);

/* Write a whole file. EXIT_DONE, or EXIT_INPUT with the message printed. */
int part_file_write(const options *o, const char *path, const void *bytes, size_t size);

/* The same for a picture. */
int part_file_picture(const options *o, const bitmap *im, const char *path);

/* Write the text and a newline to standard output, and free it; an interrupt waits until it is
 * out. */
int part_file_print(const options *o, json_text *j);

#endif
