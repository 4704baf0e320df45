#include "part_file.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* The globals of the program: a signal handler has no other context. */
static char *volatile part; /* what an interrupt removes */
static char *name;          /* what is being written */
static char *whole;         /* what it is to become; NULL: it has its name already */
static volatile sig_atomic_t held, pending; /* an interrupt waits; one is waiting */
static pid_t owner;                         /* readers may fork; a child leaves without a word */

static void interrupted(int number)
{
    static const char text[] = "umbrage: interrupted; nothing was left half-written\n";
    char *unfinished = part;
    (void)number;
    if (getpid() != owner) {
        _exit(EXIT_INTERRUPTED);
    }
    if (held) {
        pending = 1;
        return;
    }
    if (unfinished) {
        unlink(unfinished);
    }
    ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    (void)written;
    _exit(EXIT_INTERRUPTED);
}

void part_file_watch(void)
{
    struct sigaction action;
    owner = getpid();
    memset(&action, 0, sizeof action);
    action.sa_handler = interrupted;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaddset(&action.sa_mask, SIGINT);
    sigaddset(&action.sa_mask, SIGTERM);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

/* A flag, not a signal mask: masks belong to threads, and any thread may get the signal. */
static void hold(void)
{
    held = 1;
}

static void release(void)
{
    held = 0;
    if (pending) {
        interrupted(SIGINT);
    }
}

/* Devices and pipes are written as they are: there is nothing to rename, and nothing to remove. */
static bool is_special(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && !S_ISREG(info.st_mode);
}

const char *part_file_begin(const char *path)
{
    size_t length = strlen(path) + 32;
    bool special = is_special(path);
    name = malloc(length);
    whole = special ? NULL : malloc(length);
    if (!name || (!whole && !special)) {
        free(name);
        free(whole);
        return NULL;
    }
    if (special) {
        snprintf(name, length, "%s", path);
    } else {
        snprintf(whole, length, "%s", path);
        snprintf(name, length, "%s.part%ld", path, (long)getpid());
        part = name;
    }
    return name;
}

bool part_file_end(bool keep)
{
    hold();
    bool done = !keep || !whole || rename(name, whole) == 0;
    int reason = errno;
    if (whole && (!keep || !done)) {
        unlink(name);
    }
    part = NULL;
    release();
    free(name);
    free(whole);
    errno = reason;
    return done;
}

int part_file_write(const options *o, const char *path, const void *bytes, size_t size)
{
    const char *place = part_file_begin(path);
    if (!place) {
        return fail(o, EXIT_INPUT, "%s: not enough memory", path);
    }
    FILE *file = fopen(place, "wb");
    bool good = file != NULL && fwrite(bytes, 1, size, file) == size;
    int reason = errno;
    if (file && fclose(file) != 0) {
        reason = good ? errno : reason;
        good = false;
    }
    if (!part_file_end(good)) {
        reason = errno;
        good = false;
    }
    return good ? EXIT_DONE
                : fail(o, EXIT_INPUT, "%s: cannot be written: %s", path, strerror(reason));
}

int part_file_picture(const options *o, const bitmap *im, const char *path)
{
    umb_error error = {0};
    const char *place = part_file_begin(path);
    if (!place) {
        return fail(o, EXIT_INPUT, "%s: not enough memory", path);
    }
    bool good = bitmap_write_png(im, place, &error);
    if (!part_file_end(good) || !good) {
        return fail(o, EXIT_INPUT, "%s: cannot be written; name a folder that exists and has space",
                    path);
    }
    return EXIT_DONE;
}

int part_file_print(const options *o, json_text *j)
{
    if (j->failed) {
        json_text_free(j);
        return fail(o, EXIT_INPUT, "not enough memory for the answer");
    }
    hold();
    bool good = fwrite(j->text, 1, j->used, stdout) == j->used && fputc('\n', stdout) != EOF &&
                fflush(stdout) == 0;
    int reason = errno;
    release();
    json_text_free(j);
    return good ? EXIT_DONE
                : fail(o, EXIT_INPUT, "standard output: cannot be written: %s", strerror(reason));
}
