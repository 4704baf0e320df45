/* A stand-in for a fuzzer's driver, for builds without one: feeds LLVMFuzzerTestOneInput every file of
 * a corpus folder, then cut and damaged copies of it, always the same ones. It finds less than a fuzzer
 * and runs in every test, under sanitizers too. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static void mutate(const uint8_t *data, size_t size, uint32_t rounds)
{
    uint8_t *copy = malloc(size > 0 ? size : 1);
    if (copy == NULL) {
        return;
    }
    feed(data, size);
    for (uint32_t i = 0; i < rounds && size > 0; ++i) {
        feed(data, below(size));
        memcpy(copy, data, size);
        damage(copy, size);
        feed(copy, size);
    }
    free(copy);
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

int main(int argc, char **argv)
{
    const char *size_name = getenv("UMBRAGE_TEST_SIZE");
    uint32_t rounds = size_name != NULL && strcmp(size_name, "small") == 0 ? 50 : 200;
    if (size_name != NULL && strcmp(size_name, "full") == 0) {
        rounds = 20000;
    }
    uint8_t noise[512];
    for (size_t i = 0; i < sizeof noise; ++i) {
        noise[i] = (uint8_t)below(256);
    }
    mutate(noise, sizeof noise, rounds);
    feed(noise, 0);

    struct dirent **names = NULL;
    int count = argc > 1 ? scandir(argv[1], &names, only_files, compare_names) : 0;
    for (int i = 0; i < count; ++i) {
        char path[4096];
        (void)snprintf(path, sizeof path, "%s/%s", argv[1], names[i]->d_name);
        size_t size = 0;
        uint8_t *data = read_file(path, &size);
        if (data == NULL) {
            (void)fprintf(stderr, "%s: cannot be read\n", path);
            return 1;
        }
        mutate(data, size, rounds);
        free(data);
        free(names[i]);
    }
    free(names);
    printf("%d files of the corpus, %u damaged copies each\n", count > 0 ? count : 0, 2 * rounds);
    return 0;
}
