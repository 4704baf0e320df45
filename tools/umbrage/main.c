/* umbrage: the command line. One file a subcommand; this one only finds it. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "part_file.h"

static const command commands[COMMAND_COUNT] = {
    [COMMAND_INFO] = {"info", "SCENE", "[--list]", "What a scene holds, and what is wrong with it",
                      cmd_info},
    [COMMAND_CULL] = {"cull", "SCENE", "--eye X,Y,Z --target X,Y,Z [options]",
                      "The visible set of one view", cmd_cull},
    [COMMAND_WALK] = {"walk", "SCENE", "--path FILE [options]", "The visible set along a path",
                      cmd_walk},
    [COMMAND_CHECK] = {"check", "SCENE", "--path FILE [options]",
                       "Compare visible sets with exact visibility, proven by rays", cmd_check},
    [COMMAND_EXPLAIN] = {"explain", "SCENE", "--eye X,Y,Z --target X,Y,Z --object ID [options]",
                         "Why an object is visible or hidden", cmd_explain},
    [COMMAND_RENDER] = {"render", "SCENE", "--eye X,Y,Z --target X,Y,Z -o FILE.png [options]",
                        "Pictures of a view", cmd_render},
    [COMMAND_GENERATE] = {"generate", "gen:NAME,key=value", "-o FILE.glb",
                          "Write a generated scene to a file", cmd_generate},
    [COMMAND_REPLAY] = {"replay", "FILE", "[options]", "Answer a captured frame again and compare",
                        cmd_replay},
    [COMMAND_REGION] = {"region", "SCENE", "--cell X0,Y0,Z0,X1,Y1,Z1 [options]",
                        "What may be seen from anywhere in a view cell", cmd_region},
};

static void print_help(void)
{
    puts("usage: umbrage SUBCOMMAND ...\n\nConservative visibility culling: nothing that can be "
         "seen is "
         "ever hidden.\n");
    for (int i = 0; i < COMMAND_COUNT; ++i) {
        printf("  %-10s %s\n", commands[i].name, commands[i].summary);
    }
    puts("\numbrage SUBCOMMAND --help lists its options; the manual is umbrage(1).");
}

static int usage(const char *what, const char *word)
{
    fprintf(stderr, "umbrage: %s%.60s%s; there are: ", what, word, word[0] ? "'" : "");
    for (int i = 0; i < COMMAND_COUNT; ++i) {
        fprintf(stderr, "%s%s", i ? ", " : "", commands[i].name);
    }
    fputc('\n', stderr);
    return EXIT_USAGE;
}

/* Text that could not be written makes a run fail as any other output would. */
static int finish(int code)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        if (code == EXIT_DONE) {
            fprintf(stderr, "umbrage: standard output: cannot be written: %s\n", strerror(errno));
            code = EXIT_INPUT;
        }
    }
    return code;
}

static int run(int which, int count, char **words)
{
    const command *c = &commands[which];
    options o;
    bool help;
    int code = options_read(c, which, count, words, &o, &help);
    if (code == EXIT_DONE && help) {
        options_help(c, which);
        return finish(EXIT_DONE);
    }
    return code == EXIT_DONE ? finish(c->run(&o)) : code;
}

int main(int count, char **words)
{
    part_file_watch();
    if (count < 2) {
        return usage("no subcommand", "");
    }
    if (strcmp(words[1], "--help") == 0 || strcmp(words[1], "-h") == 0) {
        print_help();
        return finish(EXIT_DONE);
    }
    if (strcmp(words[1], "--version") == 0) {
        printf("umbrage %s\n", umb_version());
        return finish(EXIT_DONE);
    }
    for (int i = 0; i < COMMAND_COUNT; ++i) {
        if (strcmp(words[1], commands[i].name) == 0) {
            return run(i, count - 2, words + 2);
        }
    }
    return usage("no subcommand '", words[1]);
}
