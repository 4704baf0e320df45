/* Results for people and for programs. */
#ifndef REPORT_H
#define REPORT_H

#include <stdio.h>

#include "contest.h"

/* One contest as text. */
void report_print(const contest *c, FILE *f);

/* All contests: PREFIX.csv, PREFIX.json. */
bool report_data(const contest *contests, uint32_t count, const char *prefix, umb_error *error);

/* All contests as a page with its plots: DIR/compare.md, DIR/compare-*.svg. */
bool report_page(const contest *contests, uint32_t count, const char *dir, umb_error *error);

/* The processor's name, from the system; never empty. */
void report_machine(char *text, size_t size);

#endif
