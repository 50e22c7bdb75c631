/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Commands of a session: tables of rows, one table a file. */
#ifndef HALHOST_COMMANDS_H
#define HALHOST_COMMANDS_H

#include <stdio.h>

#include "session.h"
#include "state.h"
#include "tokens.h"

struct inifile;

struct hal_session {
    struct hal_session_options options;
    struct inifile *ini;
    unsigned depth;   /* of `source` */
    const char *file; /* being executed, for `print` */
    unsigned line;
    bool echo, ended;
    FILE *output; /* of `save TYPE FILE`, instead of options.write */
};

enum { HAL_ANY = HAL_TOKENS_MAX };

struct hal_command {
    const char *name;
    size_t min, max; /* arguments */
    int (*run)(struct hal_session *session, char *const *args, size_t count, struct hm2_diag *diag);
    const char *usage, *help;
    /* What each argument is, for completion, the last letter for all that follow: p pin, P pin or parameter, s signal,
     * f function, t thread, c component, l loadable component, w word of the usage, - nothing. */
    const char *completes;
    bool keep_quotes; /* the command wants its arguments with their quotes */
};

/* Tables end with a row without a name. */
extern const struct hal_command hal_link_commands[], hal_value_commands[], hal_show_commands[], hal_save_commands[],
    hal_run_commands[], hal_session_commands[];
extern const struct hal_command *const hal_command_tables[]; /* NULL-terminated */

void hal_print(struct hal_session *session, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* halcmd's patterns: a name matches when it begins with one of them or fits it as a shell pattern. No patterns: all. */
bool hal_match(char *const *patterns, size_t count, const char *name);
bool hal_is_arrow(const char *word);
/* Arrow that halcmd shows for a linked pin, seen from the pin. */
const char *hal_pin_arrow(const struct hh_pin *pin);

/* What `show`, `list` and `save` are asked for: patterns, and a type or HAL_TYPE_UNSPECIFIED. */
struct hal_filter {
    char *const *patterns;
    size_t count;
    hal_type_t type;
};
bool hal_filter_name(const struct hal_filter *filter, const char *name, hal_type_t type);

/* Kinds of objects, as bits; the order is that of `show all`. */
enum hal_kind {
    HAL_KIND_COMP = 1,
    HAL_KIND_PIN = 2,
    HAL_KIND_PIN_ALIAS = 4,
    HAL_KIND_SIG = 8,
    HAL_KIND_PARAM = 16,
    HAL_KIND_PARAM_ALIAS = 32,
    HAL_KIND_FUNCT = 64,
    HAL_KIND_THREAD = 128,
};

/* cmd_json.c */
void hal_show_json(struct hal_session *session, unsigned kinds, const struct hal_filter *filter);
int hal_open_output(struct hal_session *session, const char *path, struct hm2_diag *diag);
int hal_close_output(struct hal_session *session, const char *path, struct hm2_diag *diag);

/* Parameter or pin by name, a parameter first. */
struct hal_object {
    const struct hh_pin *pin;
    const struct hh_param *param;
    hal_type_t type;
};
bool hal_find_object(const char *name, struct hal_object *object);
struct hh_value hal_object_value(const struct hal_object *object);

#endif
