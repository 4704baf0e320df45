#include "checksum.h"

/* The five primes of the description. */
#define PRIME_1 0x9E3779B185EBCA87u
#define PRIME_2 0xC2B2AE3D27D4EB4Fu
#define PRIME_3 0x165667B19E3779F9u
#define PRIME_4 0x85EBCA77C2B2AE63u
#define PRIME_5 0x27D4EB2F165667C5u

static uint64_t rotate(uint64_t x, int bits)
{
    return x << bits | x >> (64 - bits);
}

static uint64_t read_little(const uint8_t *p, int bytes)
{
    uint64_t x = 0;
    for (int i = bytes - 1; i >= 0; --i) {
        x = x << 8 | p[i];
    }
    return x;
}

static uint64_t stir(uint64_t lane, uint64_t input)
{
    return rotate(lane + input * PRIME_2, 31) * PRIME_1;
}

uint64_t umb_checksum(const void *bytes, size_t size)
{
    const uint8_t *p = bytes;
    size_t left = size;
    uint64_t h = PRIME_5;
    if (size >= 32) {
        uint64_t lanes[4] = {PRIME_1 + PRIME_2, PRIME_2, 0, 0 - PRIME_1};
        for (; left >= 32; left -= 32) {
            for (int i = 0; i < 4; ++i, p += 8) {
                lanes[i] = stir(lanes[i], read_little(p, 8));
            }
        }
        h = rotate(lanes[0], 1) + rotate(lanes[1], 7) + rotate(lanes[2], 12) + rotate(lanes[3], 18);
        for (int i = 0; i < 4; ++i) {
            h = (h ^ stir(0, lanes[i])) * PRIME_1 + PRIME_4;
        }
    }
    h += size;
    for (; left >= 8; left -= 8, p += 8) {
        h = rotate(h ^ stir(0, read_little(p, 8)), 27) * PRIME_1 + PRIME_4;
    }
    for (; left >= 4; left -= 4, p += 4) {
        h = rotate(h ^ read_little(p, 4) * PRIME_1, 23) * PRIME_2 + PRIME_3;
    }
    for (; left > 0; --left, ++p) {
        h = rotate(h ^ *p * PRIME_5, 11) * PRIME_1;
    }
    h = (h ^ h >> 33) * PRIME_2;
    h = (h ^ h >> 29) * PRIME_3;
    return h ^ h >> 32;
}
