/* Which ways to build an index there are, and what they are called. */
#ifndef UMB_INDEX_NAME_H
#define UMB_INDEX_NAME_H

#include "umbrage/index.h"

/* True if there is such an index. */
bool umb_index_name_known(const umb_index_def *def);

/* All of a definition that decides what is built, in one number, for captures; and back: false if there is none. */
uint32_t umb_index_name_pack(const umb_index_def *def);
bool umb_index_name_unpack(uint32_t packed, umb_index_def *out);

#endif
