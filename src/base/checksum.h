/* XXH64, a checksum of 64 bits after its published description; the same on every machine. */
#ifndef UMB_CHECKSUM_H
#define UMB_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

uint64_t umb_checksum(const void *bytes, size_t size);

#endif
