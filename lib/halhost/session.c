/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Files, lines, looking commands up. */
#include "commands.h"
#include "inifile.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FILE_BYTES_MAX = 16 << 20, DEPTH_MAX = 16 };

const struct hal_command *const hal_command_tables[] = {
    hal_link_commands,
    hal_value_commands,
    hal_show_commands,
    hal_save_commands,
    hal_run_commands,
    hal_session_commands,
    NULL,
};

struct hal_session *hal_session_new(const struct hal_session_options *const options)
{
    struct hal_session *const session = calloc(1, sizeof *session);
    if (session)
        session->options = *options;
    return session;
}

void hal_session_free(struct hal_session *const session)
{
    if (session) {
        inifile_free(session->ini);
        free(session);
    }
}

bool hal_session_ended(const struct hal_session *const session)
{
    return session->ended;
}

/* ---- output ----------------------------------------------------------------------------------------------------- */

void hal_print(struct hal_session *const session, const char *const format, ...)
{
    char text[1024];
    va_list args;
    va_start(args, format);
    const int wanted = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (wanted < 0)
        return;
    const size_t length = (size_t)wanted < sizeof text ? (size_t)wanted : sizeof text - 1;
    if (session->output)
        (void)fwrite(text, 1, length, session->output);
    else if (session->options.write)
        session->options.write(session->options.context, text, length);
}

int hal_open_output(struct hal_session *const session, const char *const path, struct hm2_diag *const diag)
{
    if (!session->options.files)
        return hm2_diag_add(diag, HM2_ERR_STATE, "files are not available here");
    session->output = fopen(path, "we");
    return session->output ? 0 : hm2_diag_add(diag, HM2_ERR_IO, "cannot write '%s': %s", path, strerror(errno));
}

int hal_close_output(struct hal_session *const session, const char *const path, struct hm2_diag *const diag)
{
    const bool failed = ferror(session->output) != 0;
    const bool lost = fclose(session->output) != 0;
    session->output = NULL;
    return failed || lost ? hm2_diag_add(diag, HM2_ERR_IO, "cannot write '%s' completely", path) : 0;
}

/* ---- helpers of commands ---------------------------------------------------------------------------------------- */

bool hal_match(char *const *const patterns, const size_t count, const char *const name)
{
    for (size_t i = 0; i < count; i++) {
        if (strncmp(patterns[i], name, strlen(patterns[i])) == 0 || fnmatch(patterns[i], name, 0) == 0)
            return true;
    }
    return count == 0;
}

bool hal_is_arrow(const char *const word)
{
    return strcmp(word, "=>") == 0 || strcmp(word, "<=") == 0 || strcmp(word, "<=>") == 0;
}

const char *hal_pin_arrow(const struct hh_pin *const pin)
{
    return pin->dir == HAL_IN ? "<==" : pin->dir == HAL_OUT ? "==>" : "<=>";
}

bool hal_find_object(const char *const name, struct hal_object *const object)
{
    const struct hh *const host = hh_host();
    *object = (struct hal_object){.param = hh_table_find(&host->params, name)};
    if (!object->param)
        object->pin = hh_table_find(&host->pins, name);
    object->type = object->param ? object->param->type : object->pin ? object->pin->type : HAL_TYPE_UNSPECIFIED;
    return object->param || object->pin;
}

struct hh_value hal_object_value(const struct hal_object *const object)
{
    return hh_load(object->type, object->param ? object->param->value : hh_pin_value(object->pin));
}

/* ---- lines ------------------------------------------------------------------------------------------------------ */

static const struct hal_command *find_command(const char *const name)
{
    for (const struct hal_command *const *table = hal_command_tables; *table; table++) {
        for (const struct hal_command *command = *table; command->name; command++) {
            if (strcmp(command->name, name) == 0)
                return command;
        }
    }
    return NULL;
}

static int run_tokens(struct hal_session *const session, struct hal_tokens *const tokens, struct hm2_diag *const diag)
{
    char **words = tokens->items;
    size_t count = tokens->count;
    /* "name = value" is another way to write "setp name value". */
    char setp[] = "setp", *swapped[3];
    if (count == 3 && strcmp(words[1], "=") == 0) {
        swapped[0] = setp;
        swapped[1] = words[0];
        swapped[2] = words[2];
        words = swapped;
    }
    const struct hal_command *const command = find_command(words[0]);
    if (!command)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "unknown command '%s'", words[0]);
    words++;
    count--;
    if (count < command->min || count > command->max)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "%s takes %s%zu argument%s, %zu given: %s %s", command->name,
                            command->min == command->max ? ""
                            : count < command->min       ? "at least "
                                                         : "at most ",
                            count < command->min ? command->min : command->max,
                            (count < command->min ? command->min : command->max) == 1 ? "" : "s", count, command->name,
                            command->usage);
    for (size_t i = 0; i < count && !command->keep_quotes; i++)
        words[i] = hal_unquote(words[i]);
    return command->run(session, words, count, diag);
}

static const char *ini_value(void *const context, const char *const section, const char *const name)
{
    const struct hal_session *const session = context;
    return session->ini ? inifile_get(session->ini, section, name) : NULL;
}

static const char *environment_value(void *const context, const char *const name)
{
    const struct hal_session *const session = context;
    return session->options.environment ? session->options.environment(session->options.context, name) : NULL;
}

static int run_line(struct hal_session *const session, const char *const line, struct hal_tokens *const tokens,
                    struct hm2_diag *const diag)
{
    const struct hal_variables variables = {environment_value, ini_value, session};
    if (session->echo)
        hal_print(session, "(%u)<echo>: %.900s\n", session->line, line);
    const int err = hal_tokens_parse(tokens, line, &variables, diag);
    return err || tokens->count == 0 ? err : run_tokens(session, tokens, diag);
}

/* Put the place in front of every sentence of found, unless they have one (file NULL). */
static void locate(struct hm2_diag *const diag, const int err, const char *const file, const unsigned line,
                   const struct hm2_diag *const found)
{
    for (const char *at = found->text; *at;) {
        const size_t length = strcspn(at, "\n");
        if (file)
            (void)hm2_diag_add(diag, err, "%s:%u: %.*s", file, line, (int)length, at);
        else
            (void)hm2_diag_add(diag, err, "%.*s", (int)length, at);
        at += length + (at[length] == '\n');
    }
}

static int interrupted(const struct hal_session *const session, struct hm2_diag *const diag)
{
    if (!session->options.wait || session->options.wait(session->options.context, 0) == HAL_WAIT_REACHED)
        return 0;
    return hm2_diag_add(diag, HM2_ERR_STATE, "interrupted");
}

/* Buffers of one level of `source`, too large for the stack of a small system. */
struct level {
    struct hal_line line;
    struct hal_tokens tokens;
    struct hm2_diag found;
};

static int run_lines(struct hal_session *const session, const char *const name, struct hal_reader *const reader,
                     struct level *const level, struct hm2_diag *const diag)
{
    int status = 1;
    while (!session->ended) {
        hm2_diag_clear(&level->found);
        status = hal_reader_next(reader, &level->line, &level->found);
        if (status == 0)
            return 0;
        session->line = level->line.number;
        if (status > 0)
            status = interrupted(session, &level->found);
        if (status == 0)
            status = run_line(session, level->line.text, &level->tokens, &level->found);
        if (status < 0) {
            /* A sourced file that failed has named its own place, and left no present file. */
            locate(diag, status, session->file ? name : NULL, level->line.number, &level->found);
            session->file = NULL;
            return status;
        }
    }
    return 0;
}

int hal_session_run_text(struct hal_session *const session, const char *const name, const char *const text,
                         const size_t length, struct hm2_diag *const diag)
{
    return hal_session_run_lines(session, name, 1, text, length, diag);
}

int hal_session_run_lines(struct hal_session *const session, const char *const name, const unsigned first_line,
                          const char *const text, const size_t length, struct hm2_diag *const diag)
{
    if (session->depth == DEPTH_MAX)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "files source each other more than %d deep", DEPTH_MAX);
    struct level *const level = malloc(sizeof *level);
    if (!level)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory to execute '%s'", name);
    struct hal_reader reader = {.at = text, .end = text + length, .line = first_line - 1};
    const char *const outer_file = session->file;
    const unsigned outer_line = session->line;
    session->file = name;
    session->depth++;
    const int err = run_lines(session, name, &reader, level, diag);
    session->depth--;
    if (!err) {
        session->file = outer_file;
        session->line = outer_line;
    }
    free(level);
    return err;
}

/* ---- files ------------------------------------------------------------------------------------------------------ */

/* The whole file, to be freed; NULL with the reason in diag. */
static char *read_file(const char *const path, size_t *const length, struct hm2_diag *const diag)
{
    FILE *const file = fopen(path, "re");
    if (!file) {
        hm2_diag_add(diag, HM2_ERR_IO, "cannot open '%s': %s", path, strerror(errno));
        return NULL;
    }
    char *text = NULL;
    size_t used = 0, capacity = 0;
    bool failed = false;
    while (!failed && !feof(file) && used <= FILE_BYTES_MAX) {
        if (used == capacity) {
            capacity = capacity ? 2 * capacity : 65536;
            char *const larger = realloc(text, capacity);
            failed = !larger;
            text = larger ? larger : text;
        }
        if (!failed)
            used += fread(text + used, 1, capacity - used, file);
        failed = failed || ferror(file);
    }
    (void)fclose(file);
    if (!failed && used <= FILE_BYTES_MAX) {
        *length = used;
        return text;
    }
    hm2_diag_add(diag, HM2_ERR_IO, failed ? "cannot read '%s'" : "'%s' is larger than 16 MiB", path);
    free(text);
    return NULL;
}

int hal_session_run_file(struct hal_session *const session, const char *const path, struct hm2_diag *const diag)
{
    if (!session->options.files)
        return hm2_diag_add(diag, HM2_ERR_STATE, "files are not available here");
    size_t length = 0;
    char *const text = read_file(path, &length, diag);
    if (!text)
        return HM2_ERR_IO;
    const int err = hal_session_run_text(session, path, text, length, diag);
    free(text);
    return err;
}

int hal_session_read_ini(struct hal_session *const session, const char *const path, struct hm2_diag *const diag)
{
    size_t length = 0;
    char *const text = read_file(path, &length, diag);
    if (!text)
        return HM2_ERR_IO;
    struct inifile *const ini = inifile_parse(text, length, path, diag);
    free(text);
    if (!ini)
        return HM2_ERR_MALFORMED;
    inifile_free(session->ini);
    session->ini = ini;
    return 0;
}

/* ---- commands about the session --------------------------------------------------------------------------------- */

static int run_source(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)count;
    return hal_session_run_file(session, args[0], diag);
}

static int run_echo(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)diag;
    if (count == 0) {
        session->echo = true;
        hal_print(session, "Echo on\n");
        return 0;
    }
    for (size_t i = 0; i < count; i++)
        hal_print(session, "%s%s", args[i], i + 1 < count ? " " : "\n");
    return 0;
}

static int run_unecho(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)args;
    (void)count;
    (void)diag;
    session->echo = false;
    hal_print(session, "Echo off\n");
    return 0;
}

static int run_print(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)diag;
    hal_print(session, "%s:%u: HALCMD MSG: %s\n", session->file, session->line, count ? args[0] : "");
    return 0;
}

static int run_quit(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)args;
    (void)count;
    (void)diag;
    session->ended = true;
    return 0;
}

static int run_help(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    if (count > 0 && !find_command(args[0]))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "unknown command '%s'", args[0]);
    for (const struct hal_command *const *table = hal_command_tables; *table; table++) {
        for (const struct hal_command *command = *table; command->name; command++) {
            if (count > 0 && strcmp(command->name, args[0]) == 0)
                hal_print(session, "%s %s\n    %s\n", command->name, command->usage, command->help);
            else if (count == 0)
                hal_print(session, "  %-10s %s\n", command->name, command->help);
        }
    }
    return 0;
}

const struct hal_command hal_session_commands[] = {
    {"source", 1, 1, run_source, "FILE", "execute the commands of a file", "-", false},
    {"echo", 0, HAL_ANY, run_echo, "[TEXT...]", "print a text; without one, print each command before it runs", "-",
     false},
    {"unecho", 0, 0, run_unecho, "", "do not print commands any more", "-", false},
    {"print", 0, 1, run_print, "[MESSAGE]", "print file, line and a message", "-", true},
    {"help", 0, 1, run_help, "[COMMAND]", "list the commands, or explain one", "h", false},
    {"quit", 0, 0, run_quit, "", "end the file or the prompt", "-", false},
    {"exit", 0, 0, run_quit, "", "end the file or the prompt", "-", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};
