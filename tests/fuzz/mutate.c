/* A stand-in for a fuzzer's driver, for builds without one: feeds LLVMFuzzerTestOneInput every file
 * of a corpus folder, then cut and damaged copies of it, the same ones in the same order each time,
 * as many as fit into a few seconds. It finds less than a fuzzer and runs in every test, under
 * sanitizers too. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static uint64_t state = 0x9E3779B97F4A7C15u;

static uint32_t below(uint64_t limit)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)((state >> 11) % limit);
}

/* The input gets a block of exactly its size, so that reading one byte too far is seen. */
static void feed(const uint8_t *data, size_t size)
{
    uint8_t *copy = calloc(size > 0 ? size : 1, 1);
    if (copy == NULL) {
        return;
    }
    if (size > 0) {
        memcpy(copy, data, size);
    }
    (void)LLVMFuzzerTestOneInput(copy, size);
    free(copy);
}

/* Numbers that readers trip over: counts, offsets and sizes at the edges of their types. */
static void damage(uint8_t *data, size_t size)
{
    static const uint32_t edges[] = {
        0,           1,           0x7F,        0xFF,        0x7FFF,      0xFFFF,      0x7FFFFFFFu,
        0x80000000u, 0xFFFFFFFFu, 0x7F800000u, 0x7FC00000u, 0xFF800000u, 0x40000000u, 0x10000u};
    /* Headers decide most, so half of the damage is done there. */
    size_t reach = below(2) == 0 && size > 256 ? 256 : size;
    for (uint32_t n = 1 + below(4); n > 0; --n) {
        if (below(2) == 0 && reach >= 4) {
            uint32_t value = edges[below(sizeof edges / sizeof edges[0])];
            memcpy(data + below(reach - 3), &value, 4);
        } else {
            data[below(reach)] = (uint8_t)below(256);
        }
    }
}

static double now(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* How much is done with one file: rounds of two copies, stopped early after so many seconds. */
typedef struct effort {
    uint32_t rounds;
    double seconds;
} effort;

static uint32_t mutate(const uint8_t *data, size_t size, effort e)
{
    uint8_t *copy = malloc(size > 0 ? size : 1);
    if (copy == NULL) {
        return 0;
    }
    feed(data, size);
    double end = now() + e.seconds;
    uint32_t round = 0;
    for (; round < e.rounds && size > 0 && now() < end; ++round) {
        feed(data, below(size));
        memcpy(copy, data, size);
        damage(copy, size);
        feed(copy, size);
    }
    free(copy);
    return 2 * round;
}

static uint8_t *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return NULL;
    }
    uint8_t *data = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        long length = ftell(file);
        rewind(file);
        data = length >= 0 ? malloc((size_t)length + 1) : NULL;
        *size = data != NULL ? fread(data, 1, (size_t)length, file) : 0;
    }
    (void)fclose(file);
    return data;
}

static int compare_names(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static int only_files(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

static effort wanted(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    if (size != NULL && strcmp(size, "full") == 0) {
        return (effort){20000, 300.0};
    }
    return size != NULL && strcmp(size, "small") == 0 ? (effort){50, 5.0} : (effort){200, 8.0};
}

int main(int argc, char **argv)
{
    struct dirent **names = NULL;
    int count = argc > 1 ? scandir(argv[1], &names, only_files, compare_names) : 0;
    count = count > 0 ? count : 0;
    effort each = wanted();
    each.seconds /= count + 1;

    uint8_t noise[512];
    for (size_t i = 0; i < sizeof noise; ++i) {
        noise[i] = (uint8_t)below(256);
    }
    feed(noise, 0);
    uint32_t fed = mutate(noise, sizeof noise, each);
    for (int i = 0; i < count; ++i) {
        char path[4096];
        (void)snprintf(path, sizeof path, "%s/%s", argv[1], names[i]->d_name);
        size_t size = 0;
        uint8_t *data = read_file(path, &size);
        if (data == NULL) {
            (void)fprintf(stderr, "%s: cannot be read\n", path);
            return 1;
        }
        fed += mutate(data, size, each);
        free(data);
        free(names[i]);
    }
    free(names);
    printf("%d files of the corpus, %u damaged inputs\n", count, (unsigned)fed);
    return 0;
}
