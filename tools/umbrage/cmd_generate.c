/* umbrage generate: a generated scene as a file. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "io/write_glb.h"
#include "json_text.h"
#include "part_file.h"
#include "progress.h"
#include "setup.h"

static int write_model(const model *m, const options *o)
{
    umb_error error = {0};
    const char *place = part_file_begin(o->output);
    if (!place) {
        return fail(o, EXIT_INPUT, "%s: not enough memory", o->output);
    }
    progress_note(o, "writing the file");
    if (!write_glb(m, place, &error)) {
        /* The message begins with the name that was written to, which is not the user's. */
        size_t length = strlen(place);
        bool named = strncmp(error.text, place, length) == 0;
        int code = fail(o, EXIT_INPUT, "%s%s", named ? o->output : "",
                        error.text + (named ? length : 0));
        part_file_end(false);
        return code;
    }
    progress_note(o, NULL);
    return part_file_end(true)
               ? EXIT_DONE
               : fail(o, EXIT_INPUT, "%s: cannot be written: %s", o->output, strerror(errno));
}

static int report(const model *m, const options *o)
{
    if (!options_given(o, "json")) {
        printf("%s: %u objects, %llu triangles\n", o->output, m->object_count,
               (unsigned long long)m->triangles);
        return EXIT_DONE;
    }
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    json_text_string(&j, "file", o->output);
    json_text_count(&j, "objects", m->object_count);
    json_text_count(&j, "triangles", m->triangles);
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

int cmd_generate(const options *o)
{
    setup s;
    if (strncmp(o->input, "gen:", 4) != 0) {
        return fail(o, EXIT_USAGE, "'%.60s' is no generator: write gen:NAME,key=value", o->input);
    }
    if (!o->output) {
        return fail(o, EXIT_USAGE, "needs a file to write: -o FILE.glb");
    }
    int code = setup_model(&s, o);
    if (code == EXIT_DONE) {
        code = write_model(s.model, o);
    }
    if (code == EXIT_DONE) {
        code = report(s.model, o);
    }
    setup_free(&s);
    return code;
}
