/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The lines of an INI file, with their numbers. */
#ifndef MODBUS_INI_H
#define MODBUS_INI_H

#include <stdbool.h>
#include <stddef.h>

#include <hm2/err.h>

struct ini_entry {
    const char *section, *name, *value; /* without the blanks around them */
    unsigned line;
    bool used;
};

struct ini {
    const char *file_name;
    char *text;
    struct ini_entry *entries;
    size_t count;
    struct hm2_diag *diag; /* problems go there */
    int err;               /* of the first problem */
};

/* 0, or the error when the text is none of an INI file. ini_free() in either case. */
int ini_parse(struct ini *ini, const char *text, size_t length, const char *file_name, struct hm2_diag *diag);
void ini_free(struct ini *ini);

/* The first of that name in the section, as LinuxCNC takes it, which counts as used; NULL = none. */
const struct ini_entry *ini_find(struct ini *ini, const char *section, const char *name);
bool ini_has_section(const struct ini *ini, const char *section);
/* A problem at a line (0 = of the file as a whole). Returns err. */
int ini_problem(struct ini *ini, int err, unsigned line, const char *format, ...) __attribute__((format(printf, 4, 5)));
/* A warning for each entry that nobody used. */
void ini_warn_unused(const struct ini *ini);

/* Whole text is a number within limits. 0, or an error that is already told. */
int ini_number(struct ini *ini, const struct ini_entry *entry, const char *text, double min, double max, bool integer,
               double *value);

#endif
