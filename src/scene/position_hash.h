/* Where a position goes in a hash table. Positions are compared by their bits: fold -0 into 0
 * first. */
#ifndef UMB_POSITION_HASH_H
#define UMB_POSITION_HASH_H

#include <stdint.h>
#include <string.h>

static inline uint32_t umb_position_hash(const float p[3])
{
    uint32_t bits[3];
    memcpy(bits, p, sizeof bits);
    uint64_t h = bits[0] * 0x9E3779B97F4A7C15u;
    h = (h ^ (h >> 32) ^ bits[1]) * 0xBF58476D1CE4E5B9u;
    h = (h ^ (h >> 32) ^ bits[2]) * 0x94D049BB133111EBu;
    return (uint32_t)(h >> 32);
}

#endif
